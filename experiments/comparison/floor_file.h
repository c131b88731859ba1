// Chaos floors that were measured before, in a file: a comparison that reads them leaves out two MPM runs a scene.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "compare/metrics/metric_list.h"
#include "core/scene/scene.h"

namespace graupel::experiments {

/// The floors of one scene (SceneComparison makes them), and what they were measured on.
struct SceneFloors {
  uint64_t scene_hash = 0;  ///< mpm::rounded_scene_hash of scene and seed
  int64_t frames = 0;
  compare::MetricValues values;             ///< floor_<metric>
  std::vector<double> position, density;    ///< error curves [frames]
  std::map<std::string, int64_t> diverged;  ///< "moved", "reseeded": the first unusable frame
};

/// Whether the JSON file says that it is one.
bool is_floor_file(const std::string& path);

/// JSON: {"format": "graupel floors", "version": 1, "scenes": {NAME: {...}}}.
class FloorFile {
 public:
  FloorFile() = default;
  /// Throws InputError naming file, place and remedy for a file that is missing, no such JSON or incomplete.
  explicit FloorFile(const std::string& path);

  /// Throws InputError where the file knows no such scene, or its floors are stale: measured on another scene, seed or
  /// number of frames.
  const SceneFloors& of(const Scene& scene, uint64_t seed, int64_t frames) const;

  const std::map<std::string, SceneFloors>& scenes() const { return scenes_; }
  void add(const std::string& scene, SceneFloors floors) { scenes_[scene] = std::move(floors); }
  /// Written aside and renamed. Throws IoError.
  void write(const std::string& path) const;

 private:
  std::string path_;
  std::map<std::string, SceneFloors> scenes_;
};

}  // namespace graupel::experiments
