// graupel bench graph: time of a frame of graph networks beside that of MPM, on scenes of many sizes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "bench/machine/roofline.h"
#include "experiments/process/common_options.h"
#include "bench/graph/libtorch_time.h"
#include "apps/verbs.h"
#include "core/parallel/instruction_set.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "experiments/models/model_runs.h"
#include "experiments/process/process.h"
#include "experiments/process/sibling_program.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "mpm/scene/scene_recipe.h"
#include "mpm/simulation.h"
#include "nn/bf16_products.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

struct BenchGraphOptions {
  CommonOptions common;
  std::vector<std::string> models = {"mpm", "mpm:fast", "mpm:coarse", "models/hgn.safetensors"};
  std::vector<int64_t> particles = {3600};
  std::string recipe = "scenes/recipes/hgn.json";
  int64_t frames = 30, settle = 150, batch = 0;
  bool libtorch = false;
};

/// One model at one state of one scene.
struct GraphBenchRow {
  std::string state, model;
  std::size_t particles = 0;
  int64_t scenes = 1;  ///< that advance at once; the cost is that of one of them
  compare::RunCost cost = {};
  double flop = 0;                            ///< of the network, a frame in the middle of the run; 0 for MPM
  std::optional<LibtorchTime> libtorch = {};  ///< of a row that is the network there; its cost is that alone
  double over_engine = 0;                     ///< of such a row: its time over the whole frame of Graupel's engine

  std::string label() const { return fmt::format("{} {} {}", particles, state, model); }
  double flop_per_second() const { return cost.network > 0 ? flop / cost.network : 0; }
};

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

class GraphBench {
 public:
  GraphBench(const BenchGraphOptions& options, Device device) : options_(options), device_(device) {
    for (const std::string& word : options.models) {
      choices_.push_back(parse_model(word));
      if (choices_.back().parts != NetworkParts::all)
        throw ConfigError("--models: '" + word + "' is a part of a network (allowed: " + mpm::variant_words() +
                          ", weights of graph networks). Use `graupel compare`");
      if (choices_.back().kind == ModelKind::reduced)
        throw ConfigError("--models: '" + word + "' is a reduced-order model, which runs its own scene alone " +
                          "(allowed: " + mpm::variant_words() +
                          ", weights of graph networks). Use `graupel bench rom`");
      networks_.push_back(choices_.back().kind == ModelKind::network
                              ? std::make_shared<const graph::LearnedSimulator>(choices_.back().weights)
                              : nullptr);
      if (networks_.back()) networks_.back()->check_runs_on(device);
    }
  }

  /// A scene as it starts to fall, and at rest on the floor, where the particles are spread.
  std::vector<GraphBenchRow> measure(int64_t particles) {
    const uint64_t seed = options_.common.seed;
    const Scene flying = scene_of_size(io::read_recipe(options_.recipe), particles, seed);
    scene_json_ = io::scene_to_json(flying);
    std::vector<GraphBenchRow> rows = measure_state(flying, "flying");
    const TimedRun truth = run_mpm(
        flying,
        {.device = device_, .seed = seed, .frames = options_.settle, .label = "to the floor", .must_finish = true});
    const Scene settled = resting_scene(flying, seed, truth.run.trajectory.frames.back().position);
    for (GraphBenchRow& row : measure_state(settled, "settled")) rows.push_back(std::move(row));
    return rows;
  }

 private:
  std::vector<GraphBenchRow> measure_state(const Scene& scene, const std::string& state) {
    const uint64_t seed = options_.common.seed;
    const StartState start = start_of(scene, seed);
    const graph::Surroundings surroundings(scene);
    std::vector<GraphBenchRow> rows;
    for (std::size_t m = 0; m < choices_.size(); ++m) {
      GraphBenchRow row = {state, choices_[m].name, start.position.size()};
      if (networks_[m]) {
        measure_network(*networks_[m], scene, surroundings, start, std::move(row), rows);
        continue;
      }
      row.cost = run_mpm(scene, {.variant = choices_[m].variant,
                                 .device = device_,
                                 .seed = seed,
                                 .frames = options_.frames,
                                 .label = row.label()})
                     .cost;
      rows.push_back(row);
      if (options_.batch < 2 || choices_[m].variant.step == mpm::StepRule::largest_stable) continue;
      row.scenes = options_.batch;
      row.cost = batch_cost(mpm::variant_scene(scene, choices_[m].variant), options_, device_, row.scenes);
      rows.push_back(std::move(row));
    }
    return rows;
  }

  /// Completes and appends the row of a network and, with --libtorch, appends those of the same network there.
  void measure_network(const graph::LearnedSimulator& network, const Scene& scene,
                       const graph::Surroundings& surroundings, const StartState& start, GraphBenchRow row,
                       std::vector<GraphBenchRow>& rows) const {
    const TimedRun run = run_network(network, scene, surroundings, start, options_.frames, device_, row.label());
    const int history = std::max(3, static_cast<int>(network.config().history) + 1);
    const NetworkState middle{scene_json_, scene.frame_time, start.particle_type,
                              middle_history(run.run.trajectory, scene, start, options_.frames, history)};
    row.cost = run.cost;
    row.flop = network.flop(surroundings, middle.history.back());
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

  const BenchGraphOptions& options_;
  Device device_;
  std::string scene_json_;  ///< of the scene that is being measured
  std::vector<ModelChoice> choices_;
  std::vector<std::shared_ptr<const graph::LearnedSimulator>> networks_;
};

/// Time of a frame of "mpm" at a row's size and state; 0 where it was not asked for.
double mpm_frame(const std::vector<GraphBenchRow>& rows, const GraphBenchRow& row) {
  for (const GraphBenchRow& other : rows)
    if (other.model == "mpm" && other.scenes == 1 && other.state == row.state && other.particles == row.particles)
      return other.cost.frame;
  return 0;
}

std::string ratio_text(double ratio) { return ratio > 0 ? fmt::format("{:.2f}", ratio) : ""; }

/// Features, grid, network, projection [ms].
std::string parts_text(const GraphBenchRow& row) {
  const compare::RunCost& c = row.cost;
  if (row.libtorch) return "network alone";
  if (c.network == 0) return "";
  return fmt::format("{:.3g}, {:.3g}, {:.3g}, {:.3g}", 1e3 * c.features, 1e3 * c.grid_build, 1e3 * c.network,
                     1e3 * c.projection);
}

constexpr const char* table_head =
    "| particles | state | model | frames or scenes at once | ms a frame | mpm's over it | time over the engine's "
    "frame | "
    "features, grid, network, projection [ms] | network's GFLOP/s | of the products' rate | GPU memory [MB] |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|\n";

/// `rate` is the device's of products [FLOP/s]; 0: unknown.
void print_row(const GraphBenchRow& row, double mpm, double rate) {
  const double reached = row.flop_per_second();
  const double at_once = row.cost.network > 0 ? row.cost.bundle : static_cast<double>(row.scenes);
  const auto text = [](bool known, double value, const char* unit) {
    return known ? fmt::format("{:.3g}{}", value, unit) : std::string();
  };
  std::printf("| %zu | %s | %s | %.0f | %.3g | %s | %s | %s | %s | %s | %s |\n", row.particles, row.state.c_str(),
              row.model.c_str(), at_once, 1e3 * row.cost.frame,
              ratio_text(row.libtorch ? 0 : mpm / row.cost.frame).c_str(), ratio_text(row.over_engine).c_str(),
              parts_text(row).c_str(), text(reached > 0, 1e-9 * reached, "").c_str(),
              text(reached > 0 && rate > 0, 100 * reached / rate, " %").c_str(),
              text(row.cost.device_bytes > 0, 1e-6 * row.cost.device_bytes, "").c_str());
  std::fflush(stdout);
}

Json json_of_libtorch(const GraphBenchRow& row) {
  const LibtorchTime& time = *row.libtorch;
  return {{"particles", row.particles},
          {"state", row.state},
          {"model", row.model},
          {"bundle", row.cost.bundle},
          {"network", row.cost.network},
          {"over_engine_frame", row.over_engine},
          {"flop", row.flop},
          {"gflop_per_second", 1e-9 * row.flop_per_second()},
          {"first_layers", name_of(time.first_layers)},
          {"libtorch", time.version},
          {"blas", time.blas},
          {"device", time.device},
          {"threads", time.threads},
          {"number_type", time.number_type}};
}

Json json_of(const GraphBenchRow& row, double mpm) {
  if (row.libtorch) return json_of_libtorch(row);
  const compare::RunCost& c = row.cost;
  Json json = {
      {"particles", row.particles}, {"state", row.state}, {"model", row.model}, {"seconds_per_frame", c.frame}};
  if (row.scenes > 1) json["scenes"] = row.scenes;
  if (mpm > 0) json["speed_against_mpm"] = mpm / c.frame;
  if (c.network > 0) {
    json["features"] = c.features;
    json["grid"] = c.grid_build;
    json["network"] = c.network;
    json["projection"] = c.projection;
    json["bundle"] = c.bundle;
    json["flop"] = row.flop;
    json["gflop_per_second"] = 1e-9 * row.flop_per_second();
  } else {
    json["substeps_per_frame"] = c.substeps;
    json["search"] = c.search;
  }
  if (c.device_bytes > 0) json["device_bytes"] = c.device_bytes;
  if (row.scenes > 1) return json;
  json["output"] = c.output;
  json["peak_bytes"] = c.peak_bytes;
  return json;
}

void bench_graph(BenchGraphOptions& options) {
  const Device device = options.common.device == "auto" ? Device::cpu : parse_device(options.common.device);
  options.common.apply();
  if (options.libtorch) training_program();  // refuses before the work
  GraphBench bench(options, device);
  const double rate = product_rate(device);
  const std::string arithmetic = device == Device::cuda
                                     ? "bf16 products"
                                     : fmt::format("{}, {}", name_of(instruction_set()), nn::name_of_products());
  std::printf("%s, %s: %.4g GFLOP/s\n%s",
              device == Device::cuda ? cuda_device_name().c_str() : fmt::format("{} threads", num_threads()).c_str(),
              arithmetic.c_str(), 1e-9 * rate, table_head);
  Json results = Json::array();
  for (const int64_t particles : options.particles) {
    const std::vector<GraphBenchRow> rows = bench.measure(particles);
    for (const GraphBenchRow& row : rows) {
      print_row(row, mpm_frame(rows, row), rate);
      results.push_back(json_of(row, mpm_frame(rows, row)));
    }
  }
  options.common.write_json({{"version", version_text()},
                             {"command", command_line()},
                             {"device", device == Device::cuda ? cuda_device_name() : name_of(device)},
                             {"threads", num_threads()},
                             {"frames", options.frames},
                             {"arithmetic", arithmetic},
                             {"product_gflop_per_second", 1e-9 * rate},
                             {"rows", results}});
}

}  // namespace

void add_bench_graph(CLI::App& bench) {
  auto options = std::make_shared<BenchGraphOptions>();
  CLI::App* verb = bench.add_subcommand("graph", "Time of a frame of graph networks beside MPM's, by size");
  verb->add_option("--models", options->models, mpm::variant_words() + ", weights of graph networks; comma-separated")
      ->delimiter(',')
      ->capture_default_str();
  verb->add_option("--particles", options->particles, "About so many: the recipe's scene, with a larger floor")
      ->check(whole_number(100, 100000000))
      ->capture_default_str();
  verb->add_option("--recipe", options->recipe, "Recipe of the scenes")->capture_default_str();
  verb->add_option("--frames", options->frames, "Frames to time (median)")
      ->check(whole_number(1))
      ->capture_default_str();
  verb->add_option("--settle", options->settle, "Frames of MPM before the settled state")
      ->check(whole_number(1))
      ->capture_default_str();
  verb->add_option("--batch", options->batch, "Time MPM with so many such scenes at once, too (0: not)")
      ->check(whole_number(0, 4096))
      ->capture_default_str();
  verb->add_flag("--libtorch", options->libtorch, "Time each network in libtorch too, by graupel-train");
  options->common.add_to(*verb);
  verb->footer(
      "Two states of each scene: as it starts to fall, and after --settle frames, at rest. Times are medians a frame; "
      "what\na network that predicts several frames at once spends on them, and MPM on several scenes, is spread over "
      "these.\nGFLOP/s: matrix products of the frame in the middle of the run, beside the rate of products alone: of a "
      "GPU the peak in\nbf16, of the CPU that of the engine's layers with rows in the cache, measured first. "
      "--libtorch "
      "times that frame's\nnetwork alone, features and grid given: as the papers write it, in libtorch's own "
      "operations, and with the first\nlayers split as Graupel's engine has them.\n\n"
      "Examples:\n  graupel bench graph --particles 3600 40000 --json graph.json\n"
      "  graupel bench graph --libtorch --models models/hgn.safetensors\n"
      "  graupel bench graph --device cuda --particles 3600 40000 1000000");
  verb->callback([options] { bench_graph(*options); });
}

}  // namespace graupel::bench
