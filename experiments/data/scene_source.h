// Where the scenes of a data set come from: a random distribution, or a sweep of one scene's parameters.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/particle_fields.h"
#include "core/scene/scene.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/scene/scene_recipe.h"

namespace graupel::experiments {

/// A scene of a data set.
struct SceneJob {
  mpm::Split split;
  int64_t index;
  int64_t attempt = 0;  ///< redraws so far
};

/// What happens to a scene that diverges: another one is drawn in its place, or the data set stays without it.
enum class OnDivergence { redraw, report };

class SceneSource {
 public:
  virtual ~SceneSource() = default;

  virtual std::string name() const = 0;
  virtual int64_t count(mpm::Split split) const = 0;
  virtual int64_t frames() const = 0;  ///< after the first, of every scene
  virtual uint64_t seed() const = 0;
  virtual FieldSet fields() const = 0;  ///< stored in every frame
  virtual int deflate() const = 0;
  virtual bool velocities() const = 0;  ///< whether those of every frame are stored
  virtual OnDivergence on_divergence() const = 0;
  /// Scenes that advance together unless the user says otherwise: as many as fill a GPU; on the CPU a thread each.
  virtual int64_t default_batch(Device device) const = 0;
  /// Depends on the recipe, the seed and the job alone. Its own seed is that of the particle sampling.
  virtual Scene scene(const SceneJob& job) const = 0;
  virtual std::vector<io::NamedValue> parameters(const SceneJob& job) const = 0;
  /// The job in words: "train scene 3".
  virtual std::string text(const SceneJob& job) const = 0;
  /// What decides on the scenes beside the seed, for the folder's card.
  virtual nlohmann::ordered_json card() const = 0;
};

/// What the command line says about the scenes.
struct SceneSourceOptions {
  std::string recipe;            ///< file
  std::vector<std::string> set;  ///< "key.path=value"
  std::string fields;            ///< "": those of the recipe
  uint64_t seed = 0;
  bool seed_given = false;
};

/// Whether a JSON file is a recipe of any kind rather than a scene. Throws as its readers do.
bool is_recipe(const std::string& path);

/// Reads the recipe. Throws ConfigError for a bad one and InputError for a missing file.
std::unique_ptr<SceneSource> open_recipe(const SceneSourceOptions& options);

}  // namespace graupel::experiments
