// graupel-bench rom: a reduced-order model on the test runs of its data set, and plots of earlier results.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "bench/commands.h"
#include "bench/reduced/rom_bench.h"
#include "bench/reduced/rom_plots.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/models/reduced_model.h"
#include "io/trajectory/input_files.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

void bench_rom(BenchRomOptions& options) {
  options.common.apply();
  if (options.from.empty() == options.data.empty())
    throw ConfigError("bench rom needs a model and its data set, or --from with earlier results (not both)");
  if (!options.from.empty() && options.plot.empty())
    throw ConfigError("--from has no use without --plot. Name the folder of the plots");
  if (options.instances > 1 && device_of_reduced_models(options.common.device) != Device::cuda)
    throw ConfigError(
        "--instances is of the GPU (on the CPU one run follows the other; allowed there: 1). Add --device cuda");
  io::check_inputs_kept({{"the model", options.model}, {"the data", options.data}}, {{"--json", options.common.json}});
  std::vector<Json> results;
  for (const std::string& file : options.from) {
    try {
      results.push_back(Json::parse(read_file(file)));
    } catch (const Json::exception& error) {
      throw InputError("'" + file + "' is no JSON (" + error.what() + "). Make it with 'graupel bench rom --json'");
    }
  }
  if (options.from.empty()) {
    results.push_back(run_rom_bench(options));
    options.common.write_json(results.back());
  }
  if (options.plot.empty()) return;
  for (const std::string& file : write_rom_plots(results, options.plot)) std::fprintf(stderr, "%s\n", file.c_str());
}

void add_run_flags(const Command& verb, BenchRomOptions& options) {
  verb.option("--step-factor", options.step_factors,
              "Steps over those of the training, instead of the model's: 1,1.5,2,4")
      .delimiter(',')
      .check(real_number(LowerBound::above_zero));
  verb.option("--samples", options.samples, "So many samples instead of the model's: 50,100,300")
      .delimiter(',')
      .check(whole_number(1))
      .show_default("the model's");
  verb.option("--sample-box", options.box, "With --samples: within this box of the reference body: low, high [m]")
      .values(6);
  verb.option("--sample-rule", options.rule, "With --samples: random, spread or patches")
      .check(one_of({"random", "spread", "patches"}))
      .show_default();
  verb.option("--cluster", options.cluster, "So many particles as one integration point").check(whole_number(1));
  verb.option("--outlier-factor", options.outlier_factor,
              "Removed: samples that count less gained nothing beside --manifold-pull; 0 alone is allowed")
      .check(shown_range(0.0, 0.0));
  verb.option("--manifold-pull", options.manifold_pull,
              "Share of the way back to the states of the training that a step takes, instead of the model's")
      .check(shown_range(0.0, 1.0));
  verb.option("--iterations", options.iterations, "Gauss-Newton iterations at most (by default 1, of CROM 20)")
      .check(whole_number(1));
  verb.option("--projection", options.projection, "Instead of the model's: position, position_velocity or velocity")
      .check(one_of({"position", "position_velocity", "velocity"}));
  verb.option("--quadrature", options.quadrature, "Instead of the model's: lagrangian or eulerian")
      .check(one_of({"lagrangian", "eulerian"}));
  verb.flag("--keep-steps", options.keep_steps, "Repeat no step at half the length where it leaves too much");
  verb.flag("--f64", options.f64, "Double precision");
  verb.option("--instances", options.instances, "With --device cuda: so many runs at once while steps are timed")
      .check(whole_number(1))
      .show_default();
  verb.flag("--other-scene", options.other_scene,
            "Run the model even where a scene differs in more than its parameters (the particles must be the same)");
}

}  // namespace

void add_rom(const Command& program) {
  auto options = std::make_shared<BenchRomOptions>();
  const Command verb = program.command("rom", "A reduced-order model on the test runs of its data set");
  const CommandOption model =
      verb.option("model", options->model, "Weights file (.safetensors)").names_file({".safetensors"});
  verb.option("data", options->data, "Folder of the data set").names_folder().needs(model);
  verb.option("--split", options->split, "test, valid or train")
      .check(one_of({"train", "valid", "test"}))
      .show_default();
  add_run_flags(verb, *options);
  verb.option("--against", options->against, "The full-order solver, frame by frame in turn: mpm,mpm:fast")
      .delimiter(',')
      .check(one_of({"mpm", "mpm:fast"}));
  verb.option("--plot", options->plot, "Folder for plots as SVG: trust, decay of the modes, errors over settings")
      .names_folder();
  verb.option("--from", options->from, "Plot these earlier --json files instead of a run").names_file({".json"});
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel bench rom models/nsf-sand.safetensors data/nsf_sand_column --against mpm,mpm:fast\n"
      "  graupel bench rom sand.safetensors data/nsf_sand --step-factor 1,1.5,2,4 --json sand.json\n"
      "  graupel bench rom --from r2.json r4.json r6.json --plot plots");
  verb.callback([options] { bench_rom(*options); });
}

}  // namespace graupel::bench
