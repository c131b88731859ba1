#include "experiments/data/generate.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/shell_words.h"
#include "experiments/data/slurm_array.h"
#include "io/trajectory/input_files.h"

namespace graupel::experiments {

namespace {

void print_slurm_script(const GenerateOptions& options) {
  const auto words = without_option(without_option(process_words(), "--emit-slurm"), "--shard");
  const std::string script = slurm_array_script(std::filesystem::read_symlink("/proc/self/exe"), words,
                                                std::filesystem::current_path(), options.slurm_tasks);
  std::fputs(script.c_str(), stdout);
}

/// Its errors come before anything is made or submitted.
std::unique_ptr<SceneSource> open_scenes(const SceneSourceOptions& options) {
  auto scenes = open_recipe(options);
  if (std::all_of(std::begin(mpm::all_splits), std::end(mpm::all_splits),
                  [&](mpm::Split split) { return scenes->count(split) == 0; }))
    throw ConfigError(
        "'" + options.recipe +
        "' has no scenes: counts.train, counts.valid and counts.test are all 0 (allowed: 1 or more in one "
        "of them at least). Raise one: --set counts.train=N");
  return scenes;
}

/// Inside a job array every task would do the whole work.
void hint_at_array(const GenerateOptions& options) {
  if (options.shard_given || environment_variable("SLURM_ARRAY_TASK_COUNT").value_or("1") == "1") return;
  std::fprintf(stderr,
               "generate: this task of a Slurm array makes all scenes; with '--shard slurm' it makes its part alone\n");
}

}  // namespace

void generate(GenerateOptions& options) {
  options.scenes.seed = options.common.seed;
  options.scenes.seed_given = options.common.seed_given;
  if (options.slurm_tasks > 0) {
    open_scenes(options.scenes);
    return print_slurm_script(options);
  }
  options.set.device = options.common.apply();
  options.set.shard = parse_shard(options.shard);
  hint_at_array(options);
  const std::string folder = options.set.folder + "/";
  io::check_inputs_kept({{"the recipe", options.scenes.recipe}},
                        {{"--json", options.common.json},
                         {"the output's folder", options.set.folder},
                         {"the output", folder + "dataset.json"},
                         {"the output", folder + "metadata.json"},
                         {"the output", folder + "redrawn.jsonl"},
                         {"the output", folder + "train.h5"},
                         {"the output", folder + "valid.h5"},
                         {"the output", folder + "test.h5"}},
                        options.scenes.set);
  const auto scenes = open_scenes(options.scenes);
  options.common.write_json(make_data_set(*scenes, options.set));
}

}  // namespace graupel::experiments
