// The snapshots that a reduced-order model is trained on: the runs of a parameter sweep, which share their particles.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/particle_fields.h"
#include "core/scene/scene.h"

namespace graupel::train {

/// A parameter of the sweep with its value in every run.
struct SweptParameter {
  std::string name, unit;
  std::vector<std::string> keys;  ///< of the scene that follow it; the first has its value
  std::vector<double> values;     ///< [runs]
};

enum class SnapshotField { position, velocity, stress, affine, deformation_gradient };
/// Numbers a particle.
int components_of(SnapshotField field);

class SnapshotSet {
 public:
  /// A split of a data set ('graupel generate' of a sweep), of which the training needs `fields` beside positions and
  /// velocities. Throws InputError when a run lacks a field, has other particles or another frame time than the first,
  /// or diverged.
  SnapshotSet(const std::string& file, const FieldSet& fields);

  const std::string& file() const { return file_; }
  int runs() const { return static_cast<int>(first_snapshot_.size()) - 1; }
  int64_t particles() const { return static_cast<int64_t>(reference_.size()); }
  /// Snapshots of all runs one after the other; those of run i from first_snapshot(i) on.
  int64_t snapshots() const { return first_snapshot_.back(); }
  int64_t first_snapshot(int run) const { return first_snapshot_[static_cast<std::size_t>(run)]; }
  const std::vector<SweptParameter>& parameters() const { return parameters_; }
  const std::vector<Vec3f>& reference() const { return reference_; }  ///< X: positions of the first frame [m]
  /// [particles]: equal for particles of one material and script.
  const std::vector<int32_t>& particle_kind() const { return particle_kind_; }
  const std::vector<double>& particle_volume() const { return particle_volume_; }  ///< of the reference body [m^3]
  const std::vector<double>& particle_mass() const { return particle_mass_; }      ///< [kg]
  const std::string& scene_json() const { return scene_json_; }                    ///< of the first run
  /// Fingerprint of the runs: their scene, parameters, lengths and particles.
  std::string hash() const;
  double frame_time() const { return frame_time_; }  ///< [s]
  int64_t substeps_per_frame() const { return substeps_per_frame_; }

  /// A field in one snapshot, [particles, components].
  std::vector<float> read(SnapshotField field, int64_t snapshot) const;
  /// Calls use(snapshot, values [particles, components]) once for every snapshot, from several threads.
  void visit(SnapshotField field, const std::function<void(int64_t, const float*)>& use) const;

 private:
  std::string file_, scene_json_;
  double frame_time_ = 0;
  int64_t substeps_per_frame_ = 1;
  std::vector<int64_t> first_snapshot_ = {0};
  std::vector<SweptParameter> parameters_;
  std::vector<Vec3f> reference_;
  std::vector<int32_t> particle_kind_;
  std::vector<double> particle_volume_, particle_mass_;
};

}  // namespace graupel::train
