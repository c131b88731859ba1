#include "train/commands/reduced_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/parallel/hardware.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/shell_words.h"
#include "core/system/stop_signal.h"
#include "train/commands/run_outputs.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_cost.h"

namespace graupel::train {

void add_reduced_options(const Command& verb, ReducedArguments& a, const std::string& device_meaning) {
  verb.option("--data", a.data, "Folder of the data set: train.h5").names_folder();
  verb.option("--out", a.out, "Run folder").names_folder().show_default().remember_in(a.out_given);
  verb.option("--config", a.config, "Settings as JSON (see --print-defaults)").names_file({".json"});
  verb.option("--set", a.set, "Override a setting: key=value, samples=300").take_all();
  verb.option("--seed", a.seed, "Seed of samples, weights and batches").remember_in(a.seed_given);
  verb.option("--threads", a.threads, "CPU threads (0: all)").check(whole_number(0, 4096)).show_default();
  verb.option("--device", a.device, device_meaning).suggest({"auto", "cpu", "cuda"}).show_default();
  verb.option("--time-limit", a.time_limit, "Seconds that networks are trained, in place of all epochs")
      .check(real_number(LowerBound::above_zero));
  verb.option("--resume", a.resume, "Go on with this run folder of networks").names_folder();
  verb.option("--json", a.json, "Write the result as JSON to this file (-: standard output)").names_file({".json"});
  verb.flag("--print-defaults", a.print_defaults, "Print every setting with its default");
}

void check_reduced_arguments(ReducedArguments& a, const std::string& recipe) {
  if (!a.resume.empty()) {
    if (!a.config.empty() || !a.set.empty() || a.seed_given)
      throw ConfigError(
          "a resumed run keeps its settings (--config, --set and --seed are for new runs). Leave them out");
    if (a.out_given) throw ConfigError("--out is for new runs (a resumed one stays in its folder). Leave it out");
    a.out = a.resume;
    if (!std::filesystem::exists(a.out + "/config.json"))
      throw InputError("'" + a.out +
                       "' is not a training run (it has no config.json). Name the folder of a run of networks");
    if (!std::filesystem::exists(a.out + "/run.json"))
      throw InputError("'" + a.out +
                       "' is a run without steps, such as of modes (it has no run.json), which goes on nowhere. Train "
                       "anew, with another --out");
    if (a.data.empty()) a.data = read_run_facts(a.out).data;
  }
  if (a.data.empty())
    throw ConfigError("--data is missing. Name the folder of a sweep ('graupel generate " + recipe + "' makes one)");
  check_data_folder(a.data);
  check_run_outputs({{"the data", a.data}, {"the settings", a.config}}, a.out, a.json);
}

std::map<std::string, std::string> provenance_of(const ReducedArguments& a, const std::string& command_line,
                                                 const std::string& config_json) {
  return {{"data", a.data}, {"command", command_line}, {"version", GRAUPEL_VERSION}, {"config", config_json}};
}

void fill_run_options(const ReducedArguments& a, const std::string& command_line, const std::string& config_json,
                      RunLog& log, StageRunOptions& options) {
  options.data = a.data;
  options.run = a.out;
  options.resume = !a.resume.empty();
  options.device = device_for_torch(a.device);
  options.threads = num_threads();
  options.should_stop = [] { return stop_signal() != 0; };
  options.message = [&log, out = a.out](const std::string& text) { log.line(text, out); };
  options.time_limit = a.time_limit;
  if (options.resume && !(a.time_limit > 0)) {
    options.time_limit = read_run_facts(a.out).time_limit;
    if (options.time_limit > 0)
      options.message(fmt::format("keeps its time limit of {} s (--time-limit sets another)", options.time_limit));
  }
  options.command_line = command_line;
  options.version = GRAUPEL_VERSION;
  options.provenance = provenance_of(a, command_line, config_json);
}

int stopped_run(const StageRunOptions& options, const std::string& verb) {
  options.message("stopped. Go on with: graupel train " + verb + " --resume " + shell_word(options.run));
  return saved_exit_code();
}

nlohmann::ordered_json json_of(const CalibrationReport& calibration) {
  return {{"runs", calibration.runs},
          {"diverged", calibration.diverged},
          {"seconds", calibration.seconds},
          {"displacement_relative_errors", calibration.errors}};
}

void write_reduced_result(const ReducedArguments& a, rom::ReducedModel& model, const nlohmann::ordered_json& facts,
                          double seconds, Device device, nn::DType modes) {
  model.provenance["training"] = facts.dump();
  model.provenance[nn::offline_cost_key] =
      nn::offline_cost_json(with_training({}, a.data, seconds, hardware_name(device, num_threads())));
  make_folder(a.out);
  nn::write_safetensors(a.out + "/weights.safetensors", model.store(modes));
  write_file_atomically(a.out + "/report.json", facts.dump(2) + "\n");
  if (!a.json.empty()) write_file_atomically(a.json, facts.dump(2) + "\n");
  std::fprintf(stderr, "trained in %s (%s of it reading): %s/weights.safetensors\n",
               human_time(facts.at("seconds").get<double>()).c_str(),
               human_time(facts.at("read_seconds").get<double>()).c_str(), a.out.c_str());
}

}  // namespace graupel::train
