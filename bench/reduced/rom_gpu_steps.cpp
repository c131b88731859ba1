#include "bench/reduced/rom_gpu_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/system/error.h"

namespace graupel::bench {

namespace {

rom::ReducedInstance instance_of(const LoadedModel& model, const StoredRun& run, ForeignScene foreign) {
  return {mpm::PreparedScene(run.scene, {.device = Device::cpu, .seed = run.seed}),
          parameters_of(model, run.scene, foreign)};
}

/// The run with parameters spread over the training's range.
std::vector<rom::ReducedInstance> spread_instances(const LoadedModel& model, const rom::ReducedInstance& one,
                                                   int64_t instances) {
  std::vector<rom::ReducedInstance> all(static_cast<std::size_t>(instances), one);
  for (std::size_t i = 0; instances > 1 && i < all.size(); ++i)
    for (std::size_t p = 0; p < one.parameters.size(); ++p) {
      const rom::ModelParameter& known = model.model.parameters[p];
      const double place = (static_cast<double>(i) + 0.5) / static_cast<double>(instances);
      all[i].parameters[p] = known.low + place * (known.high - known.low);
    }
  return all;
}

}  // namespace

GpuSteps time_gpu_steps_of(const LoadedModel& model, const std::vector<StoredRun>& runs, const RomRunOptions& options,
                           int64_t instances) {
  constexpr int warm_up = 3, measured = 20;  // frames
  std::vector<rom::ReducedInstance> all;
  if (!model.model.fields->stress_follows_deformation())
    all = spread_instances(model, instance_of(model, runs.front(), options.foreign), instances);
  for (auto i = static_cast<int64_t>(all.size()); i < instances; ++i)
    all.push_back(instance_of(model, runs[static_cast<std::size_t>(i) % runs.size()], options.foreign));
  rom::ReducedDeviceSolver solver(model.model, std::move(all), reduced_options(options, model.model));
  std::vector<double> step;  // [us]
  for (int64_t f = 0; f < std::min<int64_t>(warm_up + measured, runs.front().scene.frames); ++f) {
    const double seconds = solver.timed_frame() / static_cast<double>(solver.steps_per_frame());
    if (f >= warm_up) step.push_back(1e6 * seconds);
  }
  if (step.empty())
    throw ConfigError(fmt::format("the scene has {} frames, too few to time steps (allowed: {} and more). Use another",
                                  runs.front().scene.frames, warm_up + 1));
  std::sort(step.begin(), step.end());
  GpuSteps result{.instances = instances,
                  .frames = static_cast<int64_t>(step.size()),
                  .steps_per_frame = solver.steps_per_frame(),
                  .median = step[step.size() / 2],
                  .low = step.front(),
                  .high = step.back(),
                  .statistics = solver.statistics(0)};
  for (int i = 0; i < solver.count(); ++i) result.diverged += solver.divergence(i) ? 1 : 0;
  result.kernels = solver.kernel_seconds();
  return result;
}

}  // namespace graupel::bench
