#include "experiments/models/model_runs.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <utility>

#include "core/math/random.h"
#include "core/parallel/memory.h"
#include "core/scene/held_particles.h"
#include "core/system/error.h"
#include "experiments/models/bundle_times.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "mpm/fast_step.h"
#include "mpm/sampling.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A line of /proc/self/status in bytes; 0 where there is none.
double status_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key + ":")) return 1024 * std::stod(line.substr(key.size() + 1));
  return 0;
}

/// Runs a scene with its own grid and step, whatever options.variant says.
TimedRun run_once(const Scene& variant, const MpmRunOptions& options) {
  const MemoryMeter memory;
  DeviceMemoryMeter device_memory(options.device);
  const auto simulation = mpm::Simulation::create(
      variant,
      {.device = options.device,
       .precision = mpm::Precision::f32,
       .seed = options.seed,
       .kernels = options.tracers && options.device == Device::cuda ? mpm::Kernels::portable : mpm::Kernels::tuned});
  TimedRun result;
  result.moved = simulation->particle_count();
  const StartState start = options.tracers ? *options.tracers : start_of(variant, options.seed);
  result.run.mass = start.mass;
  result.run.volume = start.volume;
  Trajectory& trajectory = result.run.trajectory;
  trajectory.particle_type = options.tracers ? start.particle_type : simulation->particle_type();
  if (options.tracers) simulation->carry_tracers(start.position, start.velocity);
  const auto frame_now = [&] {
    if (!options.tracers) return simulation->frame();
    ParticleFrame frame;
    frame.time = simulation->time();
    frame.position = simulation->tracers();
    return frame;
  };
  trajectory.frame_time = variant.frame_time;
  trajectory.seed = options.seed;
  trajectory.made_by = "mpm";
  trajectory.frames.push_back(frame_now());
  std::vector<double> solver, output;
  double carried = 0;  // time of the tracers so far, which are no part of the run
  Progress progress(options.label, options.frames);
  for (int64_t f = 1; f <= options.frames; ++f) {
    stop_if_interrupted();
    const auto begin = Clock::now();
    try {
      simulation->advance_frame();
    } catch (const DivergedError&) {
      if (options.must_finish) throw;
      trajectory.diverged_at_frame = f;
      break;
    }
    solver.push_back(seconds_since(begin) - (simulation->tracer_seconds() - carried));
    carried = simulation->tracer_seconds();
    const auto solved = Clock::now();
    trajectory.frames.push_back(frame_now());
    output.push_back(seconds_since(solved));
    trajectory.frames.back().velocity.clear();  // the comparison reads positions
    trajectory.frames.back().velocity.shrink_to_fit();
    progress.update(f);
  }
  if (trajectory.diverged_at_frame < 0) progress.done();
  device_memory.look();
  result.cost.device_bytes = device_memory.taken();
  result.cost.frame = median(solver);
  result.cost.output = median(output);
  const auto frames_run = static_cast<double>(std::max<std::size_t>(1, solver.size()));
  result.cost.substeps = static_cast<double>(simulation->statistics().substeps) / frames_run;
  result.cost.peak_bytes = memory.peak();
  result.cost.added_bytes = memory.added();
  compare::hold_last_frame(trajectory, static_cast<std::size_t>(options.frames));
  return result;
}

/// On a GPU the tuned kernels, which carry no tracers, tell the time, and the portable ones the places.
TimedRun run_as_is(const Scene& variant, const MpmRunOptions& options) {
  if (options.tracers == nullptr || options.device == Device::cpu) return run_once(variant, options);
  MpmRunOptions timed = options;
  timed.tracers = nullptr;
  const TimedRun tuned = run_once(variant, timed);
  TimedRun result = run_once(variant, options);
  result.cost = tuned.cost;
  return result;
}

/// With the largest stable step, searched for; the search and every run that blew up all the same count as its cost.
TimedRun run_fast(const Scene& scene, const MpmRunOptions& options) {
  const mpm::SimulationOptions simulation{
      .device = options.device, .precision = mpm::Precision::f32, .seed = options.seed};
  mpm::FastStep step;
  try {
    step = mpm::find_fast_step(scene, simulation, options.frames, [] { stop_if_interrupted(); });
  } catch (const DivergedError&) {
    return run_as_is(scene, options);  // a stored truth's scene, which does not run here with its own step
  }
  for (;;) {
    const auto begin = Clock::now();
    TimedRun result = run_as_is(step.scene, options);
    result.cost.search = step.seconds;
    if (result.run.trajectory.diverged_at_frame < 0 || step.substeps >= step.data_substeps) return result;
    step = mpm::shorter_step(step, scene);
    step.seconds += seconds_since(begin);
  }
}

/// Times of a reduced run's frames [s].
struct ReducedTimes {
  std::vector<double> frame, fields, grid, search, output;
  rom::StepTiming sum;  ///< of all frames so far

  void add_parts(const rom::StepTiming& now) {
    fields.push_back(now.decode + now.inversion - sum.decode - sum.inversion);
    grid.push_back(now.grid + now.device - sum.grid - sum.device);
    search.push_back(now.search - sum.search);
    sum = now;
  }
  compare::RunCost cost(const MemoryMeter& memory) const {
    const auto frames = static_cast<double>(std::max<std::size_t>(1, frame.size()));
    return {.frame = median(frame),
            .network = median(fields),
            .grid_build = median(grid),
            .features = median(search),
            .output = median(output),
            .peak_bytes = memory.peak(),
            .added_bytes = memory.added(),
            .substeps = static_cast<double>(sum.steps) / frames};
  }
};

}  // namespace

ModelChoice parse_model(const std::string& word) {
  if (const auto variant = mpm::parse_variant(word)) return {word, ModelKind::mpm, *variant};
  if (word.starts_with("mpm:"))
    throw ConfigError("unknown model '" + word + "' (allowed: " + mpm::variant_words() +
                      ", corrections-only or a weights file). Correct --models");
  if (word == "corrections-only")
    return {.name = word, .kind = ModelKind::network, .parts = NetworkParts::corrections_alone};
  for (const auto& [suffix, parts] : {std::pair{":no-corrections", NetworkParts::network_alone},
                                      std::pair{":corrections-only", NetworkParts::corrections_alone}}) {
    if (!word.ends_with(suffix)) continue;
    const std::string file = word.substr(0, word.size() - std::strlen(suffix));
    if (is_reduced_model(file))
      throw ConfigError("'" + word + "' asks for a part of a reduced-order model, which has no corrections (allowed: " +
                        "graph networks). Name '" + file + "' alone");
    return {.name = word, .kind = ModelKind::network, .weights = file, .parts = parts};
  }
  return {.name = word, .kind = is_reduced_model(word) ? ModelKind::reduced : ModelKind::network, .weights = word};
}

HeldLaws laws_of(NetworkParts parts, HeldLaws whole) {
  if (parts == NetworkParts::network_alone) return {.density_limit = 0, .free_flight = false, .project = false};
  whole.network = parts == NetworkParts::all;
  return whole;
}

StartState start_of(const Scene& scene, uint64_t seed) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  StartState start;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    const auto& material =
        scene.materials.at(particles.material_names[static_cast<std::size_t>(particles.material[p])]);
    start.particle_type.push_back(particle_type_of(material.model));
    start.position.push_back(particles.position[p].cast<float>());
    start.velocity.push_back(particles.velocity[p].cast<float>());
    start.volume.push_back(particles.volume[p]);
    start.mass.push_back(particles.volume[p] * material.density);
  }
  return start;
}

namespace {

/// The scene with points for particles, by source.
Scene scene_of_points(const Scene& scene, std::vector<std::vector<Vec3d>> points) {
  Scene changed = scene;
  for (std::size_t s = 0; s < changed.sources.size(); ++s) {
    Source& source = changed.sources[s];
    source.shape = Shape::points;
    source.mesh.reset();
    source.points = std::make_shared<const std::vector<Vec3d>>(std::move(points[s]));
    source.position = {0, 0, 0};
    source.rotation_angle = 0;
  }
  return changed;
}

Vec3d within_walls(const Scene& scene, Vec3d x) {
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  for (int d = 0; d < 3; ++d) x[d] = std::clamp(x[d], low[d], high[d]);
  return x;
}

}  // namespace

Scene moved_scene(const Scene& scene, uint64_t seed, double distance) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  std::vector<std::vector<Vec3d>> points(scene.sources.size());
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    const Random random(seed, RandomPurpose::metric_subset, p);
    Vec3d direction;
    double unused;
    random.normal(0, 0, direction[0], direction[1]);
    random.normal(0, 1, direction[2], unused);
    const Vec3d x = particles.position[p] + normalized(direction) * distance;
    points[static_cast<std::size_t>(particles.source[p])].push_back(within_walls(scene, x));
  }
  return scene_of_points(scene, std::move(points));
}

Scene resting_scene(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& position) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  GRAUPEL_ASSERT(particles.position.size() == position.size());
  std::vector<std::vector<Vec3d>> points(scene.sources.size());
  for (std::size_t p = 0; p < position.size(); ++p)
    points[static_cast<std::size_t>(particles.source[p])].push_back(within_walls(scene, position[p].cast<double>()));
  Scene resting = scene_of_points(scene, std::move(points));
  for (Source& source : resting.sources) {
    source.velocity = Vec3d::zero();
    source.angular_velocity = Vec3d::zero();
  }
  return resting;
}

TimedRun run_mpm(const Scene& scene, const MpmRunOptions& options) {
  const Scene variant = mpm::variant_scene(scene, options.variant);
  if (options.variant.step == mpm::StepRule::largest_stable) return run_fast(variant, options);
  return run_as_is(variant, options);
}

TimedRun run_network(const graph::LearnedSimulator& simulator, const Scene& scene,
                     const graph::Surroundings& surroundings, const StartState& start, int64_t frames, Device device,
                     const std::string& label, const HeldLaws& laws) {
  const MemoryMeter memory;
  DeviceMemoryMeter device_memory(device);
  const int history = static_cast<int>(simulator.config().history) + 1;
  const auto past = graph::start_history(start.position, start.velocity, scene.gravity, scene.frame_time, history,
                                         held_particles(start.particle_type));
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
  auto last = Clock::now();
  options.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    stop_if_interrupted();
    total.add(frame, timing.wall);
    events.add(frame, device == Device::cuda ? timing.total() : 0);
    features.push_back(timing.features);
    hierarchy.push_back(timing.hierarchy);
    network.push_back(timing.network);
    projection.add(frame, timing.projection);
    output.add(frame, seconds_since(last) - timing.wall);
    if (frame == frames) device_memory.look();
    progress.update(frame);
    last = Clock::now();
  };
  TimedRun result;
  result.run.trajectory = simulator.rollout(scene, surroundings, start.particle_type, past, options);
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

TimedRun run_reduced(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t frames, Device device,
                     const std::string& label) {
  const MemoryMeter memory;
  ReducedRun run(model, scene, seed, {}, {.outside = OutsideRange::be_quiet, .device = device});
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
    const auto begin = Clock::now();
    try {
      run.advance_frame();
    } catch (const DivergedError&) {
      trajectory.diverged_at_frame = f;
      break;
    }
    times.frame.push_back(seconds_since(begin));
    const auto solved = Clock::now();
    keep_frame();
    times.output.push_back(seconds_since(solved));
    times.add_parts(run.statistics().timing);
    progress.update(f);
  }
  if (trajectory.diverged_at_frame < 0) progress.done();
  std::fprintf(stderr, "%s: %s\n", label.c_str(), trust_line(model.model, run.trust_record()).c_str());
  result.cost = times.cost(memory);
  compare::hold_last_frame(trajectory, static_cast<std::size_t>(frames));
  return result;
}

MemoryMeter::MemoryMeter() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // sets VmHWM back to the present size
  before_ = status_bytes("VmRSS");
}

double MemoryMeter::peak() const {
  const double high = status_bytes("VmHWM");
  if (high > 0) return high;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

double MemoryMeter::added() const { return std::max(0.0, peak() - before_); }

DeviceMemoryMeter::DeviceMemoryMeter(Device device) : device_(device) {
  if (device == Device::cuda) free_before_ = static_cast<double>(available_bytes(device));
}

void DeviceMemoryMeter::look() {
  if (device_ == Device::cuda) taken_ = std::max(taken_, free_before_ - static_cast<double>(available_bytes(device_)));
}

}  // namespace graupel::experiments
