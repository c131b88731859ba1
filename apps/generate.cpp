// graupel generate: recipe + seed -> data set.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "experiments/data/data_set.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct GenerateOptions {
  CommonOptions common;
  SceneSourceOptions scenes;
  DataSetOptions set;
  std::string shard = "0/1";
};

Shard parse_shard(const std::string& text) {
  Shard shard;
  char tail = 0;
  long long i = 0, n = 0;
  if (std::sscanf(text.c_str(), "%lld/%lld%c", &i, &n, &tail) != 2 || n < 1 || i < 0 || i >= n)
    throw ConfigError("--shard '" + text + "' is not I/N with 0 <= I < N. Example: --shard 2/8");
  shard.i = i;
  shard.n = n;
  return shard;
}

void generate(GenerateOptions& options) {
  options.set.device = options.common.apply();
  options.set.shard = parse_shard(options.shard);
  options.scenes.seed = options.common.seed;
  options.scenes.seed_given = options.common.seed_given;
  const auto scenes = open_recipe(options.scenes);
  options.common.write_json(make_data_set(*scenes, options.set));
}

}  // namespace

void add_generate(CLI::App& app) {
  auto options = std::make_shared<GenerateOptions>();
  CLI::App* verb = app.add_subcommand("generate", "Make a data set of random scenes, or of a parameter sweep");
  verb->add_option("recipe", options->scenes.recipe, "Recipe file (scenes/recipes/*.json)")->required();
  verb->add_option("-o,--output", options->set.folder, "Folder of the data set")->required();
  verb->add_option("--set", options->scenes.set,
                   "Change a recipe key: --set counts.train=100; of a sweep's scene: --set scene.domain.dx=0.02")
      ->allow_extra_args(false);
  verb->add_option("--fields", options->scenes.fields,
                   "Store these of every frame too: stress,affine,deformation_gradient,plastic");
  verb->add_option("--shard", options->shard, "Make every N-th scene, from I on: I/N")->capture_default_str();
  verb->add_option("--batch", options->set.batch,
                   "Scenes that advance together (0: what fills a GPU, at most 64; 1 a thread on the CPU); the bytes "
                   "do not depend on it")
      ->check(whole_number(0))
      ->capture_default_str();
  verb->add_option("--minutes", options->set.minutes, "Start no scene after this time (0: no limit)")
      ->check(real_number(LowerBound::zero));
  verb->add_option("--connectivity-radius", options->set.connectivity_radius,
                   "Written to metadata.json for graph networks [m]")
      ->check(real_number(LowerBound::above_zero))
      ->capture_default_str();
  options->common.add_to(*verb);
  verb->footer(
      "A recipe draws random scenes, or names a scene and the values of its parameters, one for each run.\n"
      "Complete scenes are skipped, so an interrupted run goes on. A random scene that diverges is redrawn and logged\n"
      "in redrawn.jsonl; a run of a sweep that diverges is an error. A scene's bytes depend on the recipe, the seed,\n"
      "its index and the kind of device alone: not on the batch, the shard or the threads.\n\nExamples:\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --set counts.train=100\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --shard 3/8 --device cuda --batch 128\n"
      "  graupel generate sweep.json -o data/sweep --set scene.frames=20");
  verb->callback([options] { generate(*options); });
}

}  // namespace graupel::apps
