// What `graupel rollout` is asked for. A weights file is of a graph network, or of a reduced-order model, which runs
// its scene from the start and so takes other flags.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"
#include "core/scene/scene.h"
#include "experiments/models/reduced_runs.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

struct RolloutOptions {
  CommonOptions common;
  std::string weights, input, output = "rollout.h5", start = "scene";
  std::vector<std::string> set;
  int64_t frames = -1, trajectory = 0;  ///< frames -1: the scene's
  bool no_project = false;
  bool no_free_flight = false;          ///< of networks
  std::optional<double> density_limit;  ///< of networks
  std::optional<double> step_factor;    ///< of reduced-order models
  std::optional<int64_t> refine;        ///< of reduced-order models: points of a particle
  int64_t stride = 1;                   ///< of reduced-order models: frames from one that is written to the next
  Arithmetic arithmetic = Arithmetic::f32;
};

bool is_trajectory(const std::string& path);
/// Header of the trajectory that --trajectory chooses. Throws ConfigError when there is none of that number, InputError
/// when it holds no scene.
Trajectory chosen_header(const io::TrajectoryReader& reader, const RolloutOptions& options);
/// The scene stored with it, changed by --set.
Scene stored_scene(const Trajectory& header, const RolloutOptions& options);

/// Runs a reduced-order model and writes its trajectory frame by frame. Throws ConfigError for a scene that the model
/// is not for, DivergedError once the frames before the divergence are written.
void rollout_reduced(const RolloutOptions& options);

}  // namespace graupel::experiments
