// Steps of a reduced-order model on a GPU, timed alone.
#pragma once

#include <array>

#include "bench/reduced/rom_measurement.h"

namespace graupel::bench {

using namespace experiments;

struct GpuSteps {
  int64_t instances = 1, frames = 0, steps_per_frame = 0;
  double median = 0, low = 0, high = 0;  ///< of the frames: a step of all instances [us]
  rom::ReducedStatistics statistics;     ///< of the first instance
  int64_t diverged = 0;                  ///< instances
  std::array<double, 4> kernels{};       ///< branch, decode, gather, fit, each launched alone [s]
};

/// The run, `instances` times at once, with parameters spread over the training's range (one instance: the run's own).
/// Throws ConfigError for a scene of too few frames, and as rom::ReducedDeviceSolver.
GpuSteps time_gpu_steps_of(const LoadedModel& model, const StoredRun& run, const RomRunOptions& options,
                           int64_t instances);

}  // namespace graupel::bench
