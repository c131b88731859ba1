#include "experiments/models/network_run.h"

#include "core/system/stopwatch.h"
#include "experiments/models/bundle_times.h"
#include "experiments/models/memory_meter.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"

namespace graupel::experiments {

HeldLaws laws_of(NetworkParts parts, HeldLaws whole) {
  if (parts == NetworkParts::network_alone) return {.density_limit = 0, .free_flight = false, .project = false};
  whole.network = parts == NetworkParts::all;
  return whole;
}

TimedRun run_network(const graph::LearnedSimulator& simulator, const Scene& scene,
                     const graph::Environment& environment, const StartState& start, int64_t frames, Device device,
                     const std::string& label, const HeldLaws& laws) {
  const MemoryMeter memory;
  DeviceMemoryMeter device_memory(device);
  const int history = static_cast<int>(simulator.config().history) + 1;
  const auto past = past_of(start, scene, history);
  const graph::ParticleSchedule schedule = schedule_of(start);
  std::vector<double> features, hierarchy, network;
  const BundleTimes none(simulator.config().bundle, frames);
  BundleTimes total = none, events = none, projection = none, output = none;
  Progress progress(label, frames);
  graph::LearnedSimulator::RolloutOptions options;
  options.frames = frames;
  options.device = device;
  options.density_limit = laws.density_limit;
  options.free_flight = laws.free_flight;
  options.project = laws.project;
  options.network = laws.network;
  options.schedule = &schedule;
  options.material = start.material;
  Stopwatch last;
  options.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    stop_if_interrupted();
    total.add(frame, timing.wall);
    events.add(frame, device == Device::cuda ? timing.total() : 0);
    features.push_back(timing.features);
    hierarchy.push_back(timing.hierarchy);
    network.push_back(timing.network);
    projection.add(frame, timing.projection);
    output.add(frame, last.seconds() - timing.wall);
    if (frame == frames) device_memory.look();
    progress.update(frame);
    last = {};
  };
  TimedRun result;
  result.run.trajectory = simulator.rollout(scene, environment, start.particle_type, past, options);
  if (result.run.trajectory.diverged_at_frame < 0) progress.done();
  for (ParticleFrame& frame : result.run.trajectory.frames) std::vector<Vec3f>().swap(frame.velocity);
  result.moved = start.position.size();
  result.run.mass = start.mass;
  result.run.volume = start.volume;
  result.cost = {.frame = median(total.times()),
                 .network = median(network),
                 .grid_build = median(hierarchy),
                 .features = median(features),
                 .projection = median(projection.times()),
                 .output = median(output.times()),
                 .peak_bytes = memory.peak(),
                 .added_bytes = memory.added(),
                 .bundle = static_cast<double>(simulator.config().bundle),
                 .events = median(events.times()),
                 .device_bytes = device_memory.taken()};
  compare::hold_last_frame(result.run.trajectory, static_cast<std::size_t>(frames));
  return result;
}

}  // namespace graupel::experiments
