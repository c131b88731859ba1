// graupel bench graph: time of a frame of graph networks beside that of MPM, on scenes of many sizes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/model_runs.h"
#include "apps/verbs.h"
#include "core/command_line.h"
#include "core/error.h"
#include "io/recipe_reader.h"
#include "mpm/scene_recipe.h"

namespace graupel::apps {

namespace {

using Json = nlohmann::ordered_json;

struct BenchGraphOptions {
  CommonOptions common;
  std::vector<std::string> models = {"mpm", "mpm:fast", "mpm:coarse", "models/hgn.safetensors"};
  std::vector<int64_t> particles = {3600};
  std::string recipe = "scenes/recipes/hgn.json";
  int64_t frames = 30, settle = 150;
};

/// One model at one state of one scene.
struct GraphBenchRow {
  std::string state, model;
  std::size_t particles = 0;
  compare::RunCost cost;
};

constexpr double recipe_particles = 3600;  ///< of a scene of the recipe, about

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

class GraphBench {
 public:
  GraphBench(const BenchGraphOptions& options, Device device) : options_(options), device_(device) {
    for (const std::string& word : options.models) {
      choices_.push_back(parse_model(word));
      if (choices_.back().kind == ModelKind::reduced)
        throw ConfigError("--models: '" + word + "' is a reduced-order model, which runs its own scene alone " +
                          "(allowed: mpm, mpm:fast, mpm:coarse, weights of graph networks). Use `graupel bench rom`");
      networks_.push_back(
          choices_.back().kind == ModelKind::network ? std::make_shared<const graph::LearnedSimulator>(word) : nullptr);
    }
  }

  /// A scene as it starts to fall, and at rest on the floor, where the particles are spread.
  std::vector<GraphBenchRow> measure(int64_t particles) {
    const uint64_t seed = options_.common.seed;
    const Scene flying = scene_of_size(io::read_recipe(options_.recipe), particles, seed);
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
      const std::string label = fmt::format("{} {} {}", start.position.size(), state, choices_[m].name);
      const TimedRun run = networks_[m]
                               ? run_network(*networks_[m], scene, surroundings, start, options_.frames, device_, label)
                               : run_mpm(scene, {.variant = choices_[m].variant,
                                                 .device = device_,
                                                 .seed = seed,
                                                 .frames = options_.frames,
                                                 .label = label});
      rows.push_back({state, choices_[m].name, start.position.size(), run.cost});
    }
    return rows;
  }

  const BenchGraphOptions& options_;
  Device device_;
  std::vector<ModelChoice> choices_;
  std::vector<std::shared_ptr<const graph::LearnedSimulator>> networks_;
};

/// Time of a frame of "mpm" at a row's size and state; 0 where it was not asked for.
double mpm_frame(const std::vector<GraphBenchRow>& rows, const GraphBenchRow& row) {
  for (const GraphBenchRow& other : rows)
    if (other.model == "mpm" && other.state == row.state && other.particles == row.particles) return other.cost.frame;
  return 0;
}

void print_row(const GraphBenchRow& row, double mpm) {
  const compare::RunCost& c = row.cost;
  const std::string faster = mpm > 0 ? fmt::format("{:.2f}", mpm / c.frame) : "";
  const std::string parts = c.network > 0 ? fmt::format("{:.3g}, {:.3g}, {:.3g}, {:.3g}", 1e3 * c.features,
                                                        1e3 * c.grid_build, 1e3 * c.network, 1e3 * c.projection)
                                          : "";
  std::printf("| %zu | %s | %s | %.3g | %s | %s |\n", row.particles, row.state.c_str(), row.model.c_str(),
              1e3 * c.frame, faster.c_str(), parts.c_str());
  std::fflush(stdout);
}

Json json_of(const GraphBenchRow& row, double mpm) {
  const compare::RunCost& c = row.cost;
  Json json = {
      {"particles", row.particles}, {"state", row.state}, {"model", row.model}, {"seconds_per_frame", c.frame}};
  if (mpm > 0) json["speed_against_mpm"] = mpm / c.frame;
  if (c.network > 0) {
    json["features"] = c.features;
    json["grid"] = c.grid_build;
    json["network"] = c.network;
    json["projection"] = c.projection;
  } else {
    json["substeps_per_frame"] = c.substeps;
    json["search"] = c.search;
  }
  json["output"] = c.output;
  json["peak_bytes"] = c.peak_bytes;
  return json;
}

void bench_graph(BenchGraphOptions& options) {
  const Device device = options.common.device == "auto" ? Device::cpu : parse_device(options.common.device);
  options.common.apply();
  GraphBench bench(options, device);
  std::printf(
      "| particles | state | model | ms a frame | mpm's over it | features, grid, network, projection [ms] |\n"
      "|---|---|---|---|---|---|\n");
  Json results = Json::array();
  for (const int64_t particles : options.particles) {
    const std::vector<GraphBenchRow> rows = bench.measure(particles);
    for (const GraphBenchRow& row : rows) {
      print_row(row, mpm_frame(rows, row));
      results.push_back(json_of(row, mpm_frame(rows, row)));
    }
  }
  options.common.write_json({{"version", version_text()},
                             {"command", command_line()},
                             {"device", device == Device::cuda ? cuda_device_name() : name_of(device)},
                             {"threads", num_threads()},
                             {"frames", options.frames},
                             {"rows", results}});
}

}  // namespace

void add_bench_graph(CLI::App& bench) {
  auto options = std::make_shared<BenchGraphOptions>();
  CLI::App* verb = bench.add_subcommand("graph", "Time of a frame of graph networks beside MPM's, by size");
  verb->add_option("--models", options->models, "mpm, mpm:fast, mpm:coarse, weights of graph networks; comma-separated")
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
  options->common.add_to(*verb);
  verb->footer(
      "Two states of each scene: as it starts to fall, and after --settle frames, at rest.\n\n"
      "Examples:\n  graupel bench graph --particles 3600 40000 --json graph.json\n"
      "  graupel bench graph --device cuda --particles 3600 40000 1000000");
  verb->callback([options] { bench_graph(*options); });
}

}  // namespace graupel::apps
