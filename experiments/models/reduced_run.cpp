#include "experiments/models/reduced_run.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/memory_meter.h"
#include "experiments/models/start_state.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"

namespace graupel::experiments {

namespace {

/// Times of a reduced run's frames [s].
struct ReducedTimes {
  std::vector<double> frame, fields, grid, search, output;
  rom::StepTiming sum;  ///< of all frames so far

  void add_parts(const rom::StepTiming& current) {
    fields.push_back(current.decode + current.inversion - sum.decode - sum.inversion);
    grid.push_back(current.grid + current.device - sum.grid - sum.device);
    search.push_back(current.search - sum.search);
    sum = current;
  }
  compare::RunCost cost(const MemoryMeter& memory, const DeviceMemoryMeter& device_memory) const {
    const auto frames = static_cast<double>(std::max<std::size_t>(1, frame.size()));
    return {.frame = median(frame),
            .network = median(fields),
            .grid_build = median(grid),
            .features = median(search),
            .output = median(output),
            .peak_bytes = memory.peak(),
            .added_bytes = memory.added(),
            .substeps = static_cast<double>(sum.steps) / frames,
            .device_bytes = device_memory.taken()};
  }
};

}  // namespace

TimedRun run_reduced(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t frames, Device device,
                     Pull pull, const std::string& label) {
  const MemoryMeter memory;
  DeviceMemoryMeter device_memory(device);
  rom::ReducedOptions options;
  if (pull == Pull::none) options.manifold_pull = 0;
  ReducedRun run(model, scene, seed, options, {.outside = OutsideRange::be_quiet, .device = device});
  TimedRun result;
  StartState start = start_of(scene, seed);
  result.run.mass = std::move(start.mass);
  result.run.volume = std::move(start.volume);
  Trajectory& trajectory = result.run.trajectory;
  trajectory.particle_type = run.particle_type();
  result.moved = trajectory.particle_type.size();
  trajectory.frame_time = scene.frame_time;
  trajectory.seed = seed;
  trajectory.made_by = model.file;
  const auto keep_frame = [&] {
    trajectory.frames.push_back(run.frame());
    std::vector<Vec3f>().swap(trajectory.frames.back().velocity);
  };
  keep_frame();
  ReducedTimes times;
  Progress progress(label, frames);
  for (int64_t f = 1; f <= frames; ++f) {
    stop_if_interrupted();
    const Stopwatch watch;
    try {
      run.advance_frame();
    } catch (const DivergedError&) {
      trajectory.diverged_at_frame = f;
      break;
    }
    times.frame.push_back(watch.seconds());
    const Stopwatch after;
    keep_frame();
    times.output.push_back(after.seconds());
    times.add_parts(run.statistics().timing);
    progress.update(f);
  }
  if (trajectory.diverged_at_frame < 0) progress.done();
  std::fprintf(stderr, "%s: %s\n", label.c_str(), trust_line(model.model, run.trust_record()).c_str());
  device_memory.look();
  result.cost = times.cost(memory, device_memory);
  result.trust = {rom::verdict_text(run.trust_record().verdict()), run.trust_record().number(), model.model.usual_error,
                  run.trust_record().bound()};
  compare::hold_last_frame(trajectory, static_cast<std::size_t>(frames));
  return result;
}

}  // namespace graupel::experiments
