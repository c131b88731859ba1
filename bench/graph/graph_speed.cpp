#include "bench/graph/graph_speed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bench/one_kind_recipe.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/memory_meter.h"
#include "experiments/process/process.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "mpm/scene/scene_recipe.h"
#include "mpm/simulation.h"

namespace graupel::bench {

using namespace experiments;

std::string GraphBenchRow::label() const { return fmt::format("{} {} {}", particles, state, model); }

namespace {

constexpr double recipe_particles = 3600;  ///< of a scene of the recipe, about

/// Time of a frame of one of `count` scenes that advance at once, each sampled by a seed of its own.
compare::RunCost batch_cost(const Scene& scene, const BenchGraphOptions& options, Device device, int64_t count) {
  std::vector<mpm::PreparedScene> scenes;
  for (int64_t i = 0; i < count; ++i)
    scenes.emplace_back(
        scene, mpm::SimulationOptions{.device = device,
                                      .precision = mpm::Precision::f32,
                                      .seed = mpm::sampling_seed(options.common.seed, mpm::Split::test, i, 0)});
  DeviceMemoryMeter memory(device);
  const auto run = mpm::SceneBatch::create(scenes);
  std::vector<double> seconds;
  for (int64_t f = 0; f < options.frames; ++f) {
    stop_if_interrupted();
    const double before = run->statistics().solver_seconds;
    run->advance_frame();
    seconds.push_back(run->statistics().solver_seconds - before);
  }
  memory.look();
  const auto n = static_cast<double>(count);
  std::sort(seconds.begin(), seconds.end());
  return {.frame = seconds[seconds.size() / 2] / n,
          .substeps = static_cast<double>(run->statistics().substeps) / static_cast<double>(options.frames),
          .device_bytes = memory.taken() / n};
}

constexpr int64_t longer = 10;  ///< rollouts whose whole time is measured, too

/// Completes the row of `count` scenes that a network predicts at once, each sampled by a seed of its own: the cost of
/// one. Nothing where they do not run together. `output` is what starts and results take beside the frames.
void time_many(const graph::LearnedSimulator& network, const Scene& scene, const graph::Environment& environment,
               const BenchGraphOptions& options, int64_t count, GraphBenchRow& row) {
  const int history = static_cast<int>(network.config().history) + 1;
  const auto run = [&](const std::vector<graph::LearnedSimulator::SceneRollout>& scenes) {
    return network.rollout_many(scenes, [](const graph::LearnedSimulator::SceneResult&) {},
                                {.progress = [](int64_t) { stop_if_interrupted(); }});
  };
  std::vector<StartState> starts;
  std::vector<std::vector<std::vector<Vec3f>>> past;
  for (int64_t i = 0; i < count; ++i) {
    starts.push_back(start_of(scene, mpm::sampling_seed(options.common.seed, mpm::Split::test, i, 0)));
    past.push_back(past_of(starts.back(), scene, history));
  }
  std::vector<graph::LearnedSimulator::SceneRollout> scenes;
  scenes.reserve(starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    graph::LearnedSimulator::RolloutOptions one;
    one.frames = network.config().bundle;
    one.material = starts[i].material;
    one.device = Device::cuda;
    scenes.push_back({std::to_string(i), &scene, &environment, &starts[i].particle_type, &past[i], one});
  }
  row.cost = {};
  if (run({scenes[0], scenes[1]}).frames == 0) return;
  DeviceMemoryMeter memory(Device::cuda);
  const auto time_runs = [&](int64_t frames, int runs) {
    for (auto& one : scenes) one.options.frames = frames;
    std::vector<double> frame, output, whole;
    constexpr int warm_up = 1;
    for (int k = 0; k < warm_up + runs; ++k) {
      const Stopwatch watch;
      const auto cost = run(scenes);
      const auto predicted = static_cast<double>(cost.frames);
      if (k < warm_up) continue;
      whole.push_back(watch.seconds() / predicted);
      frame.push_back(cost.seconds / predicted);
      output.push_back(whole.back() - frame.back());
    }
    row.whole[frames] = median(whole);
    memory.look();
    return compare::RunCost{
        .frame = median(frame), .output = median(output), .device_bytes = memory.taken() / static_cast<double>(count)};
  };
  row.cost = time_runs(options.frames, 5);
  time_runs(longer * options.frames, 3);
}

/// A scene of the recipe's density: floor, groups and obstacles grow with the particles.
Scene scene_of_size(const SceneRecipe& recipe, int64_t particles, uint64_t seed) {
  SceneRecipe larger = recipe;
  const double area = static_cast<double>(particles) / recipe_particles;
  const auto grown = [&](int64_t count) {
    return std::max<int64_t>(1, std::llround(static_cast<double>(count) * area));
  };
  for (const int axis : {0, 2}) larger.domain.size[axis] *= std::sqrt(area);
  larger.groups.count = grown(recipe.groups.count);
  if (recipe.obstacles.count > 0) larger.obstacles.count = grown(recipe.obstacles.count);
  return mpm::draw_scene(larger, seed, mpm::Split::test, 0);
}

/// The newest `count` frames from which the frame in the middle of a network's run was predicted.
std::vector<std::vector<Vec3f>> middle_history(const Trajectory& run, const Scene& scene, const StartState& start,
                                               int64_t frames, int count) {
  const int64_t usable = run.diverged_at_frame < 0 ? frames : run.diverged_at_frame - 1;
  auto history = graph::start_history(start.position, start.velocity, scene.gravity, scene.frame_time, count);
  for (int64_t f = 1; f <= usable / 2; ++f) history.push_back(run.frames[static_cast<std::size_t>(f)].position);
  history.erase(history.begin(), history.end() - count);
  return history;
}

}  // namespace

GraphBench::GraphBench(const BenchGraphOptions& options, Device device) : options_(options), device_(device) {
  for (const std::string& word : options.models) {
    choices_.push_back(parse_model(word, choices_));
    if (choices_.back().parts != NetworkParts::all)
      throw ConfigError("--models: '" + word + "' is a part of a network (allowed: " + mpm::variant_words() +
                        ", weights of graph networks). Use `graupel compare`");
    if (choices_.back().kind == ModelKind::reduced)
      throw ConfigError("--models: '" + word + "' is a reduced-order model, which runs its own scene alone " +
                        "(allowed: " + mpm::variant_words() + ", weights of graph networks). Use `graupel bench rom`");
    networks_.push_back(choices_.back().kind == ModelKind::network
                            ? std::make_shared<const graph::LearnedSimulator>(choices_.back().contents)
                            : nullptr);
    if (networks_.back()) networks_.back()->check_runs_on(device);
  }
}

std::vector<GraphBenchRow> GraphBench::measure(int64_t particles) {
  const uint64_t seed = options_.common.seed;
  const Scene flying = scene_of_size(read_one_kind_recipe(options_.recipe), particles, seed);
  scene_json_ = io::scene_to_json(flying);
  std::vector<GraphBenchRow> rows = measure_state(flying, "flying");
  const TimedRun truth = run_mpm(
      flying,
      {.device = device_, .seed = seed, .frames = options_.settle, .label = "to the floor", .must_finish = true});
  const Scene settled = resting_scene(flying, seed, truth.run.trajectory.frames.back().position);
  for (GraphBenchRow& row : measure_state(settled, "settled")) rows.push_back(std::move(row));
  return rows;
}

std::vector<GraphBenchRow> GraphBench::measure_state(const Scene& scene, const std::string& state) {
  const uint64_t seed = options_.common.seed;
  const StartState start = start_of(scene, seed);
  const graph::Environment environment(scene);
  std::vector<GraphBenchRow> rows;
  for (std::size_t m = 0; m < choices_.size(); ++m) {
    GraphBenchRow row = {state, choices_[m].name, start.position.size()};
    if (networks_[m]) {
      measure_network(*networks_[m], scene, environment, start, row, rows);
      if (device_ == Device::cuda) measure_many(*networks_[m], scene, environment, std::move(row), rows);
      continue;
    }
    row.cost = run_mpm(scene, {.variant = choices_[m].variant,
                               .device = device_,
                               .seed = seed,
                               .frames = options_.frames,
                               .label = row.label()})
                   .cost;
    rows.push_back(row);
    if (choices_[m].variant.step == mpm::StepRule::largest_stable) continue;
    for (const int64_t count : options_.batch) {
      row.scenes = count;
      row.cost = batch_cost(mpm::variant_scene(scene, choices_[m].variant), options_, device_, count);
      rows.push_back(row);
    }
  }
  return rows;
}

void GraphBench::measure_network(const graph::LearnedSimulator& network, const Scene& scene,
                                 const graph::Environment& environment, const StartState& start, GraphBenchRow row,
                                 std::vector<GraphBenchRow>& rows) const {
  const TimedRun run = run_network(network, scene, environment, start, options_.frames, device_, row.label());
  const int history = std::max(3, static_cast<int>(network.config().history) + 1);
  const NetworkState middle{scene_json_, scene.frame_time, start.particle_type,
                            middle_history(run.run.trajectory, scene, start, options_.frames, history)};
  row.cost = run.cost;
  row.flop = network.flop(environment, middle.history.back());
  rows.push_back(row);
  const bool diverged_at_once = row.cost.frame == 0;
  if (!options_.libtorch || diverged_at_once) return;
  for (const graph::FirstLayers first_layers : {graph::FirstLayers::whole, graph::FirstLayers::split}) {
    const LibtorchTime time = time_in_libtorch(row.model, middle, first_layers, device_);
    GraphBenchRow there = row;
    there.model += first_layers == graph::FirstLayers::whole ? " (libtorch)" : " (libtorch, split)";
    const double seconds = time.seconds / row.cost.bundle;
    there.cost = {.frame = seconds, .network = seconds, .bundle = row.cost.bundle};
    there.flop = time.flop / row.cost.bundle;
    there.libtorch = time;
    there.over_engine = seconds / row.cost.frame;
    rows.push_back(std::move(there));
  }
}

void GraphBench::measure_many(const graph::LearnedSimulator& network, const Scene& scene,
                              const graph::Environment& environment, GraphBenchRow row,
                              std::vector<GraphBenchRow>& rows) const {
  for (const int64_t count : options_.batch) {
    row.scenes = count;
    row.whole.clear();
    time_many(network, scene, environment, options_, count, row);
    if (row.cost.frame > 0) rows.push_back(row);
  }
}

}  // namespace graupel::bench
