// graupel simulate: a scene, or a saved state, becomes a trajectory.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel {
struct Scene;
}
namespace graupel::io {
struct TrajectoryWriteOptions;
}

namespace graupel::experiments {

struct SimulateOptions {
  CommonOptions common;
  std::string scene, output, precision = "f32", write_obstacles, fields, save_state, resume;
  std::vector<std::string> set;
  int64_t frames = -1, save_every = 0;
  bool dry_run = false, print_defaults = false, no_velocity = false, precision_given = false;
  bool forces = false;         ///< of the matter on obstacles and walls
  bool deterministic = false;  ///< asked for; every solver is

  /// Of the file of the scene, for messages: the state's where no scene was named.
  const std::string& scene_file() const { return scene.empty() ? resume : scene; }
  io::TrajectoryWriteOptions write_options(const Scene& scene_to_run) const;
};

/// Runs the scene, or tells what it would need (dry_run), or prints every key (print_defaults). What the user left open
/// is filled in. Throws ConfigError, InputError, DivergedError once the frames before are written, and IoError.
void simulate(SimulateOptions& options);

}  // namespace graupel::experiments
