// graupel compare: scenes x models -> table, CSV, JSON and report.html.
#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/system/command_line.h"
#include "experiments/comparison/compare_runs.h"
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

void add_compare(CLI::App& app) {
  auto verb = std::make_shared<CompareVerb>();
  CompareOptions& options = verb->compare;
  CLI::App* command = app.add_subcommand("compare", "Hold learned simulators and cheaper MPM settings against MPM");
  command->add_option("--scenes", options.scenes, "Scene files, folders of them, or data sets (.h5)")->required();
  command
      ->add_option("--models", options.models,
                   mpm::variant_words() +
                       ", weights files of networks and reduced-order models; corrections-only; a network's "
                       "WEIGHTS:no-corrections; comma-separated")
      ->required()
      ->delimiter(',');
  command->add_option("--frames", options.frames, "Frames to predict; default the scene's")->check(whole_number(1));
  command->add_option("--set", options.set, "Change a scene key: --set domain.dx=0.02 (repeatable)")
      ->allow_extra_args(false);
  command->add_option("--one-step-stride", options.one_step_stride, "Frames between one-step errors")
      ->check(whole_number(1))
      ->capture_default_str();
  command
      ->add_option("--density-limit", options.density_limit,
                   "Largest density in rollouts of networks, of that at rest; 0: none")
      ->check(real_number(0, 10))
      ->capture_default_str();
  command->add_flag("!--no-free-flight", options.free_flight,
                    "Let networks change the momentum of what flies freely in rollouts");
  command->add_flag("--one-step-only", options.one_step_only, "No rollouts, one-step errors alone");
  command->add_flag("--no-floors", verb->no_floors, "Leave out the chaos floors (two MPM runs a scene)");
  command
      ->add_option("--floors", options.floor_file,
                   "Read the chaos floors from this file (--write-floors) instead of running MPM twice more a scene")
      ->excludes("--no-floors");
  command->add_option("--write-floors", options.write_floors, "Write the chaos floors to this file")
      ->excludes("--no-floors");
  command->add_option("--csv", options.csv, "Write a row a scene and model to this file");
  command->add_option("--report", options.report, "Write tables, curves, pictures and a 3-D player (.html)");
  command->add_option("--pictures", options.pictures,
                      "Write a contact sheet a scene and model into this folder (.png)");
  verb->common.add_to(*command);
  command->footer(
      "Examples:\n  graupel compare --scenes scenes/shared --models mpm,mpm:coarse,models/hgn.safetensors --report "
      "report.html\n"
      "  graupel compare --scenes valid.h5 --models models/hgn.safetensors --frames 100 --json out.json\n"
      "  graupel compare --scenes scenes/shared/sand_column.json --models mpm,models/nsf-sand.safetensors --set "
      "materials.sand.friction_angle=33\n"
      "docs/metrics.md defines the metrics.");
  command->callback([verb] { compare_verb(*verb); });
}

}  // namespace graupel::apps
