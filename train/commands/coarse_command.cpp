#include "train/commands/coarse_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/parallel/hardware.h"
#include "core/parallel/thread_pool.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/installed_folder.h"
#include "core/system/stop_signal.h"
#include "io/scene/category_reader.h"
#include "nn/offline_cost.h"
#include "train/coarse/coarse_training.h"
#include "train/commands/run_log.h"
#include "train/commands/run_outputs.h"
#include "train/loop/run_folder.h"
#include "train/parallel/rank_environment.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string recipe = "scenes/recipes/general.json", out = "runs/coarse", device = "auto", from, target = "cpu", json;
  CoarseTrainingOptions training;
  int threads = 0;
};

Json json_of(const Judgement& judged) {
  return {{"cost", judged.cost},
          {"ratio_position", judged.position},
          {"ratio_density", judged.density},
          {"ratio_time", judged.time}};
}

int train(Arguments arguments, const std::string& command_line) {
  require_one_process("'graupel train coarse'");
  arguments.recipe = or_installed(arguments.recipe);
  if (!io::is_category_recipe(arguments.recipe))
    throw ConfigError(
        fmt::format("'{}' is no recipe of categories, which this training draws its scenes from (allowed: a .json with "
                    "\"categories\"). Name one, such as scenes/recipes/general.json",
                    arguments.recipe));
  check_run_outputs({{"the recipe", arguments.recipe}, {"the weights", arguments.from}}, arguments.out, arguments.json);
  check_new_run(arguments.out);
  CoarseTrainingOptions options = arguments.training;
  options.recipe = io::read_category_recipe(arguments.recipe);
  options.device = parse_device(arguments.device);
  options.target = arguments.target == "cuda" ? Device::cuda : Device::cpu;
  set_num_threads(arguments.threads);
  if (!arguments.from.empty()) options.from = hybrid::CoarseModel::load(nn::read_safetensors(arguments.from));
  RunLog log;
  options.message = [&](const std::string& text) { log.line(text, arguments.out); };
  options.should_stop = [] { return stop_signal() != 0; };
  options.provenance = {{"recipe", arguments.recipe}, {"command", command_line}, {"version", GRAUPEL_VERSION}};
  const std::string file = arguments.out + "/weights.safetensors";
  options.improved = [&](const hybrid::CoarseModel& model) { nn::write_safetensors(file, model.store()); };
  catch_stop_signals();
  const FileLock hold = lock_run(arguments.out);
  const CoarseTrainingResult result = train_coarse(options);
  const Json facts = {{"sweeps", result.sweeps},
                      {"seconds", result.seconds},
                      {"data_seconds", result.data_seconds},
                      {"train_scenes", result.train_scenes},
                      {"valid_scenes", result.valid_scenes},
                      {"valid_before", json_of(result.before)},
                      {"valid", json_of(result.after)}};
  hybrid::CoarseModel model = result.model;
  model.metadata["training"] = facts.dump();
  nn::OfflineCost cost = options.from ? nn::offline_cost_of(options.from->metadata, arguments.from) : nn::OfflineCost();
  const std::string device = hardware_name(options.device, num_threads());
  cost.data.push_back({"", result.data_seconds, device});
  cost.training.push_back({"", result.seconds, device});
  model.metadata[nn::offline_cost_key] = nn::offline_cost_json(cost);
  nn::write_safetensors(file, model.store());
  write_file_atomically(arguments.out + "/report.json", facts.dump(2) + "\n");
  if (!arguments.json.empty()) write_file_atomically(arguments.json, facts.dump(2) + "\n");
  options.message(fmt::format(
      "{} sweeps in {}; split valid over MPM on 2 dx at its largest step: position {:.3f}, density "
      "{:.3f}, predicted "
      "time {:.3f}; {}",
      result.sweeps, human_time(result.seconds), result.after.position, result.after.density, result.after.time, file));
  return saved_exit_code();
}

}  // namespace

void add_coarse_command(const Command& app, const std::string& command_line, int& exit_code) {
  auto a = std::make_shared<Arguments>();
  const Command verb = app.command("coarse", "Constants with which MPM on a coarse grid follows the fine one");
  verb.option("--recipe", a->recipe, "Recipe of categories that the scenes are drawn from")
      .names_file({".json"})
      .show_default();
  verb.option("--from", a->from, "Begin with the constants and steps of this weights file")
      .names_file({".safetensors"});
  verb.option("--out", a->out, "Run folder").names_folder().show_default();
  verb.option("--target", a->target, "cpu or cuda: where a run may cost no more than MPM on 2 dx at its largest step")
      .check(one_of({"cpu", "cuda"}))
      .show_default();
  verb.option("--minutes", a->training.minutes, "Stop the search after this wall time")
      .check(real_number(LowerBound::above_zero));
  verb.option("--sweeps", a->training.sweeps, "Sweeps through the constants, each with half the step of the one before")
      .check(whole_number(1))
      .show_default();
  verb.option("--scenes", a->training.scenes, "Scenes drawn for training").check(whole_number(1)).show_default();
  verb.option("--valid-scenes", a->training.valid_scenes, "Scenes drawn to choose among the sweeps")
      .check(whole_number(1))
      .show_default();
  verb.option("--frames", a->training.frames, "Frames of a run").check(whole_number(10)).show_default();
  verb.option("--seed", a->training.seed, "Seed of the scenes").show_default();
  verb.option("--device", a->device, "auto, cpu or cuda").suggest({"auto", "cpu", "cuda"}).show_default();
  verb.option("--threads", a->threads, "CPU threads (0: all)").check(whole_number(0, 4096)).show_default();
  verb.option("--json", a->json, "Write the result as JSON to this file (-: standard output)").names_file({".json"});
  verb.footer(
      "Examples:\n  graupel train coarse --out runs/coarse --minutes 10\n"
      "  graupel train coarse --recipe my_scenes.json --target cuda --out runs/coarse-gpu");
  verb.callback([a, command_line, &exit_code] { exit_code = train(*a, command_line); });
}

}  // namespace graupel::train
