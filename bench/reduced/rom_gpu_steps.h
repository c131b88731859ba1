// Steps of a reduced-order model on a GPU, timed alone.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "bench/reduced/rom_measurement.h"

namespace graupel::bench {

using namespace experiments;

struct GpuSteps {
  int64_t instances = 1, frames = 0, steps_per_frame = 0;
  double median = 0, low = 0, high = 0;                      ///< of the frames: a step of all instances [us]
  rom::ReducedStatistics statistics;                         ///< of the first instance
  int64_t diverged = 0;                                      ///< instances
  std::vector<std::pair<std::string, double>> kernels = {};  ///< each launched alone [s]
};

/// The first of the runs, `instances` times at once, with parameters spread over the training's range (one instance:
/// the run's own). For a model of the deformation alone, whose parameters act through the scene, the runs in turn.
/// Throws ConfigError for a scene of too few frames, and as rom::ReducedDeviceSolver.
GpuSteps time_gpu_steps_of(const LoadedModel& model, const std::vector<StoredRun>& runs, const RomRunOptions& options,
                           int64_t instances);

}  // namespace graupel::bench
