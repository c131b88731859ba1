// graupel compare: scenes x models -> table, CSV, JSON and report.html.
#include <memory>

#include "apps/verbs.h"
#include "experiments/comparison/compare_runs.h"
#include "experiments/process/common_options.h"
#include "experiments/process/process.h"
#include "mpm/scene_variants.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct CompareVerb {
  CommonOptions common;
  CompareOptions compare;
  bool no_floors = false;
};

void compare_verb(CompareVerb& verb) {
  verb.compare.device = verb.common.device;
  verb.compare.threads = verb.common.threads;
  verb.compare.json = verb.common.json;
  if (verb.common.seed_given) verb.compare.seed = verb.common.seed;
  verb.compare.floors = !verb.no_floors;
  verb.compare.command = command_line();
  run_compare(verb.compare);
}

}  // namespace

void add_compare(const Command& app) {
  auto verb = std::make_shared<CompareVerb>();
  CompareOptions& options = verb->compare;
  const Command command =
      app.command("compare", "Hold learned simulators, reduced-order models and cheaper MPM settings against MPM");
  command
      .option(
          "scenes,--scenes", options.scenes,
          "Scene files, folders of them, data sets (.h5 or their folders) and recipes; a number N takes the first N "
          "scenes of a data set or recipe, FIRST:END those from FIRST to END - 1")
      .names_file({".json", ".h5"})
      .names_folder()
      .required();
  command.option("--split", options.split, "Of recipes and data sets' folders: train, valid or test")
      .suggest({"train", "valid", "test"});
  command
      .option("--models", options.models,
              mpm::variant_words() +
                  ", weights files of networks, reduced-order models and coarse MPM; corrections-only; a network's "
                  "WEIGHTS:no-corrections, a reduced-order model's WEIGHTS:no-pull; comma-separated")
      .suggest(mpm::variant_list())
      .suggest({"corrections-only"})
      .names_file({".safetensors"})
      .required()
      .delimiter(',');
  command
      .option("--training-runs", options.training_runs,
              "Data set of the reduced-order models (folder, or train.h5): adds its nearest run and the interpolation "
              "between its runs as baselines")
      .names_file({".h5"})
      .names_folder();
  command.option("--frames", options.frames, "Frames to predict; default the scene's").check(whole_number(1));
  command.option("--set", options.set, "Change a scene key: --set domain.dx=0.02 (repeatable)").one_value_each();
  command.option("--one-step-stride", options.one_step_stride, "Frames between one-step errors")
      .check(whole_number(1))
      .show_default();
  command
      .option("--density-limit", options.density_limit,
              "Largest density in rollouts of networks, of that at rest; 0: none")
      .check(real_number(0, 10))
      .show_default();
  command.flag("!--no-free-flight", options.free_flight,
               "Let networks change the momentum of what flies freely in rollouts");
  command.flag("--forces", options.forces,
               "Record the forces of runs of MPM on obstacles and walls for the report, by a second run each");
  command.flag("--one-step-only", options.one_step_only, "No rollouts, one-step errors alone");
  command.flag("--no-floors", verb->no_floors, "Leave out the chaos floors (two MPM runs a scene)");
  command
      .option("--floors", options.floor_file,
              "Read the chaos floors from this file (--write-floors) instead of running MPM twice more a scene")
      .names_file({".json"})
      .excludes("--no-floors");
  command.option("--write-floors", options.write_floors, "Write the chaos floors to this file")
      .names_file({".json"})
      .excludes("--no-floors");
  command.option("--csv", options.csv, "Write a row a scene and model to this file").names_file({".csv"});
  command.option("--report", options.report, "Write tables, curves, pictures and a 3-D player (.html)")
      .names_file({".html"});
  command.option("--pictures", options.pictures, "Write a contact sheet a scene and model into this folder (.png)")
      .names_folder();
  verb->common.add_to(command);
  command.footer(
      "Examples:\n  graupel compare --scenes scenes/shared --models mpm,mpm:coarse,models/hgn.safetensors --report "
      "report.html\n"
      "  graupel compare --scenes valid.h5 --models models/hgn.safetensors --frames 100 --json out.json\n"
      "  graupel compare scenes/recipes/general.json --split valid --models mpm:fast,mpm:coarse:fast\n"
      "  graupel compare data/jelly --split test --models mpm,runs/jelly/weights.safetensors --training-runs "
      "data/jelly\n"
      "docs/reference/metrics.md defines the metrics.");
  command.callback([verb] { compare_verb(*verb); });
}

}  // namespace graupel::apps
