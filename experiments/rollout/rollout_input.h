// Where a rollout starts: a scene, or a trajectory and the scene stored in it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "experiments/rollout/rollout.h"
#include "graph/features/particle_schedule.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

bool is_trajectory(const std::string& path);
/// Header of the trajectory that --trajectory chooses. Throws ConfigError when there is none of that number, InputError
/// when it holds no scene.
Trajectory chosen_header(const io::TrajectoryReader& reader, const RolloutOptions& options);
/// The scene stored with it, changed by --set.
Scene stored_scene(const Trajectory& header, const RolloutOptions& options);

struct SceneAndSeed {
  Scene scene;
  uint64_t seed = 0;
};
/// The scene that is run from its start, or the one stored with a trajectory.
SceneAndSeed scene_and_seed(const RolloutOptions& options);

/// Writes a trajectory without velocities, with who is active where its frames say so.
void write_positions(const std::string& file, const Trajectory& trajectory);

/// The state that a graph network starts from.
struct RolloutStart {
  Scene scene;
  std::vector<int32_t> particle_type;
  std::vector<int32_t> material;                  ///< indices into the scene's materials, where asked for; or empty
  ParticleMaterials kept_materials;               ///< for the trajectory that is written
  std::vector<std::vector<Vec3f>> history;        ///< positions [m] of frames, oldest first
  std::vector<std::vector<Vec3f>> rest;           ///< of a trajectory: its frames after the start
  std::vector<std::vector<uint8_t>> rest_active;  ///< and which particles are in the run in them, or empty ones
  graph::ParticleSchedule schedule;               ///< births and scripts
  std::vector<uint8_t> active;  ///< of a trajectory: those in the run at the start; empty: all that are born
  double time = 0;              ///< [s] of the start in the scene
  uint64_t seed = 0;
  bool unknown_gravity = false;  ///< other programs' data do not say it
};

/// With `history` frames: of a scene, and of the first frame of a trajectory (--start scene), a ballistic past; of
/// --start truth:N the first frames themselves. `materials`: of the particles are asked for. Throws ConfigError and
/// InputError.
RolloutStart rollout_start(const RolloutOptions& options, int history, bool materials);

}  // namespace graupel::experiments
