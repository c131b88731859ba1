#include "train/commands/nsf_command.h"

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/stop_signal.h"
#include "io/config/config_description.h"
#include "train/commands/run_log.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_cost.h"
#include "train/parallel/rank_environment.h"
#include "train/reduced/mlp_training.h"
#include "train/reduced/nsf_training.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string data, out = "runs/nsf", config, json, resume, device = "auto";
  std::vector<std::string> set;
  uint64_t seed = 0;
  bool seed_given = false;
  int threads = 0;
  double time_limit = 0;
  bool print_defaults = false;
};

NsfConfig config_of(const Arguments& arguments) {
  std::vector<std::string> overrides = arguments.set;
  if (arguments.seed_given) overrides.push_back("seed=" + std::to_string(arguments.seed));
  const std::string text = arguments.config.empty() ? "{}" : read_file(arguments.config);
  return io::read_config<NsfConfig>(text, arguments.config.empty() ? "command line" : arguments.config, overrides);
}

Json json_of(const FieldReport& field) {
  return {{"modes", field.modes},
          {"tail", field.tail},
          {"held_out_error", field.held_out_error},
          {"ridge", field.ridge},
          {"branch_seconds", field.branch_seconds}};
}

/// The model, what the training tells and `seconds` of all its parts, in the run folder.
void write_result(const Arguments& arguments, rom::ReducedModel& model, const Json& facts, double seconds,
                  Device device, ModeStorage storage) {
  model.provenance["training"] = facts.dump();
  model.provenance[nn::offline_cost_key] =
      nn::offline_cost_json(with_training({}, arguments.data, seconds, hardware_name(device, num_threads())));
  make_folder(arguments.out);
  nn::write_safetensors(arguments.out + "/weights.safetensors",
                        model.store(storage == ModeStorage::f16 ? nn::DType::f16 : nn::DType::f32));
  write_file_atomically(arguments.out + "/report.json", facts.dump(2) + "\n");
  if (!arguments.json.empty()) write_file_atomically(arguments.json, facts.dump(2) + "\n");
  std::fprintf(stderr, "trained in %s (%s of it reading): %s/weights.safetensors\n",
               human_time(facts.at("seconds").get<double>()).c_str(),
               human_time(facts.at("read_seconds").get<double>()).c_str(), arguments.out.c_str());
}

std::map<std::string, std::string> provenance_of(const Arguments& arguments, const std::string& command_line,
                                                 const std::string& config_json) {
  return {{"data", arguments.data}, {"command", command_line}, {"version", GRAUPEL_VERSION}, {"config", config_json}};
}

void train_modes(const Arguments& arguments, const NsfConfig& config, const std::string& command_line) {
  if (!arguments.resume.empty() || arguments.time_limit > 0 || arguments.device == "cuda")
    throw ConfigError(
        "--resume, --time-limit and --device cuda are for networks (field=factored takes seconds on the CPU). Leave "
        "them out, or --set field=mlp");
  NsfTrainingOptions options;
  options.data = arguments.data;
  options.config = config;
  options.message = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  NsfReport report;
  const std::string config_json = io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact);
  options.provenance = provenance_of(arguments, command_line, config_json);
  rom::ReducedModel model = train_factored(options, report);
  const Json facts = {{"snapshots", report.snapshots},
                      {"seconds", report.seconds},
                      {"read_seconds", report.read_seconds},
                      {"latent_tail", report.latent_tail},
                      {"deformation", json_of(report.deformation)},
                      {"stress", json_of(report.stress)},
                      {"affine", json_of(report.affine)},
                      {"calibration",
                       {{"runs", report.calibration.runs},
                        {"diverged", report.calibration.diverged},
                        {"seconds", report.calibration.seconds},
                        {"displacement_relative_errors", report.calibration.errors}}}};
  make_folder(arguments.out);
  write_file_atomically(arguments.out + "/config.json", config_json + "\n");
  write_result(arguments, model, facts, report.seconds, Device::cpu, config.storage);
}

int train_networks(const Arguments& arguments, const NsfConfig& config, const std::string& command_line) {
  MlpTrainingOptions options;
  options.data = arguments.data;
  options.run = arguments.out;
  options.config = config;
  options.resume = !arguments.resume.empty();
  options.device = device_for_torch(arguments.device);
  options.threads = num_threads();
  options.time_limit = arguments.time_limit;
  options.command_line = command_line;
  options.version = GRAUPEL_VERSION;
  options.should_stop = [] { return stop_signal() != 0; };
  RunLog log;
  options.message = [&](const std::string& text) { log.line(text, arguments.out); };
  options.provenance =
      provenance_of(arguments, command_line, io::write_json(io::json_of_struct(config), io::JsonLayout::compact));
  MlpReport report;
  catch_stop_signals();
  std::optional<rom::ReducedModel> model = train_mlp(options, report);
  if (!model) {
    options.message("stopped. Go on with: graupel train nsf --resume " + arguments.out);
    return stop_signal() == SIGINT ? static_cast<int>(ExitCode::interrupted) : 0;
  }
  Json facts = {{"snapshots", report.snapshots},
                {"seconds", report.seconds},
                {"read_seconds", report.read_seconds},
                {"latent_tail", report.latent_tail},
                {"device", name_of(options.device)}};
  for (const MlpStageReport& stage : report.stages)
    facts[stage.name] = {{"width", stage.width},
                         {"steps", stage.steps},
                         {"seconds", stage.seconds},
                         {"loss", stage.loss},
                         {"error", stage.error}};
  write_result(arguments, *model, facts, report.run_seconds, options.device, config.storage);
  return 0;
}

/// A resumed run keeps its settings and its data.
NsfConfig resumed_config(Arguments& arguments) {
  if (!arguments.config.empty() || !arguments.set.empty() || arguments.seed_given)
    throw ConfigError("a resumed run keeps its settings (--config, --set and --seed are for new runs). Leave them out");
  arguments.out = arguments.resume;
  const std::string file = arguments.out + "/config.json";
  if (!std::filesystem::exists(file))
    throw InputError("'" + arguments.out + "' is not a training run (it has no config.json). Name a run of field=mlp");
  if (arguments.data.empty()) arguments.data = read_run_facts(arguments.out).data;
  return io::read_config<NsfConfig>(read_file(file), file, {});
}

int train(Arguments arguments, const std::string& command_line) {
  if (arguments.print_defaults) {
    fmt::print("{}\n", io::commented_json(io::describe<NsfConfig>(), io::json_of_struct(NsfConfig())));
    return 0;
  }
  require_one_process("'graupel train nsf'");
  const NsfConfig config = arguments.resume.empty() ? config_of(arguments) : resumed_config(arguments);
  if (arguments.data.empty())
    throw ConfigError(
        "--data is missing. Name the folder of a sweep ('graupel generate scenes/recipes/nsf_sand_quick.json' makes "
        "one)");
  set_num_threads(arguments.threads);
  if (config.field == rom::FieldKind::mlp) return train_networks(arguments, config, command_line);
  train_modes(arguments, config, command_line);
  return 0;
}

}  // namespace

void add_nsf_command(const Command& app, const std::string& command_line, int& exit_code) {
  auto a = std::make_shared<Arguments>();
  const Command verb = app.command("nsf", "A reduced-order model of a parameter sweep (Neural Stress Fields)");
  verb.option("--data", a->data, "Folder of the data set: train.h5");
  verb.option("--out", a->out, "Run folder").show_default();
  verb.option("--config", a->config, "Settings as JSON (see --print-defaults)");
  verb.option("--set", a->set, "Override a setting: key=value, samples=300").take_all();
  verb.option("--seed", a->seed, "Seed of the choice of samples").remember_in(a->seed_given);
  verb.option("--threads", a->threads, "CPU threads (0: all)").check(whole_number(0, 4096)).show_default();
  verb.option("--device", a->device, "auto, cpu or cuda, for field=mlp").show_default();
  verb.option("--time-limit", a->time_limit, "Seconds that networks are trained, in place of all epochs")
      .check(real_number(LowerBound::above_zero));
  verb.option("--resume", a->resume, "Go on with this run folder of networks");
  verb.option("--json", a->json, "Write the result as JSON to this file (-: standard output)");
  verb.flag("--print-defaults", a->print_defaults, "Print every setting with its default");
  verb.footer(
      "Examples:\n  graupel train nsf --data data/nsf_sand_column --out runs/nsf-sand\n"
      "  graupel train nsf --data data/nsf_sand_column --set latents=5 --set storage=f16 --out runs/small\n"
      "  graupel train nsf --data data/nsf_jelly --set field=mlp --set mlp.deformation_beta=32 --time-limit 300");
  verb.callback([a, command_line, &exit_code] { exit_code = train(*a, command_line); });
}

}  // namespace graupel::train
