// graupel rollout: a learned simulator predicts a scene. A weights file is of a graph network, or of a reduced-order
// model, which runs its scene from the start and so takes other flags.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct RolloutOptions {
  CommonOptions common;
  std::string weights, input, output = "rollout.h5", start = "scene";
  std::vector<std::string> set;
  int64_t frames = -1, trajectory = 0;  ///< frames -1: the scene's
  bool all = false;                     ///< of networks: all trajectories of a data set
  bool no_project = false;
  bool no_free_flight = false;          ///< of networks
  std::optional<double> density_limit;  ///< of networks
  std::optional<double> step_factor;    ///< of reduced-order models
  std::optional<int64_t> refine;        ///< of reduced-order models: points of a particle
  int64_t stride = 1;                   ///< of reduced-order models: frames from one that is written to the next
  bool f64 = false;                     ///< of reduced-order models: double precision
  std::string projection, quadrature;   ///< of reduced-order models; empty: the model's
  std::vector<std::string> loads;       ///< of reduced-order models: TIME:DURATION:X,Y,Z:RADIUS:FX,FY,FZ
};

/// Predicts, writes the trajectory, prints a summary. Throws ConfigError for flags that the model or the input does not
/// know, and as rollout_network, rollout_reduced and rollout_coarse.
void rollout(RolloutOptions& options);

}  // namespace graupel::experiments
