// graupel generate: recipe + seed -> data set.
#include <memory>

#include "apps/verbs.h"
#include "experiments/data/generate.h"

namespace graupel::apps {

using namespace experiments;

void add_generate(const Command& app) {
  auto options = std::make_shared<GenerateOptions>();
  const Command verb = app.command("generate", "Make a data set of random scenes, or of a parameter sweep");
  verb.option("recipe", options->scenes.recipe, "Recipe file (scenes/recipes/*.json)").names_file({".json"}).required();
  verb.option("-o,--output", options->set.folder, "Folder of the data set").names_folder().required();
  verb.option("--set", options->scenes.set,
              "Change a recipe key: --set counts.train=100; of a sweep's scene: --set scene.domain.dx=0.02")
      .one_value_each();
  verb.option("--fields", options->scenes.fields,
              "Store these of every frame too: stress,affine,deformation_gradient,plastic");
  verb.option("--shard", options->shard,
              "Make every N-th scene, from I on: I/N; slurm: this task's part of its job array")
      .show_default()
      .remember_in(options->shard_given);
  verb.option("--emit-slurm", options->slurm_tasks,
              "Print a script that submits this to Slurm instead: an array of so many tasks, and a job that finishes "
              "the set")
      .check(whole_number(1, 100000))
      .excludes("--shard");
  verb.option("--batch", options->set.batch,
              "Scenes that advance together (0: what fills a GPU, at most 64; 1 a thread on the CPU); the bytes "
              "do not depend on it")
      .check(whole_number(0))
      .show_default();
  verb.option("--minutes", options->set.minutes, "Start no scene after this time (0: no limit)")
      .check(real_number(LowerBound::zero));
  verb.option("--connectivity-radius", options->set.connectivity_radius,
              "Written to metadata.json for graph networks [m]")
      .check(real_number(LowerBound::above_zero))
      .show_default();
  options->common.add_to(verb);
  verb.footer(
      "A recipe draws random scenes, or names a scene and the values of its parameters, one for each run.\n"
      "Complete scenes are skipped, so an interrupted run goes on. A random scene that diverges is redrawn and logged\n"
      "in redrawn.jsonl; a run of a sweep that diverges is an error. A scene's bytes depend on the recipe, the seed,\n"
      "its index, the kind of device and the build alone: not on the batch, the shard or the threads.\n\nExamples:\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --set counts.train=100\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --shard 3/8 --device cuda --batch 128\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --emit-slurm 8 > submit.sh\n"
      "  graupel generate sweep.json -o data/sweep --set scene.frames=20");
  verb.callback([options] { generate(*options); });
}

}  // namespace graupel::apps
