#include "train/commands/nsf_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "train/commands/reduced_command.h"
#include "train/loop/run_folder.h"
#include "train/parallel/rank_environment.h"
#include "train/reduced/mlp_training.h"
#include "train/reduced/nsf_training.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

Json json_of(const FieldReport& field) {
  return {{"modes", field.modes},
          {"tail", field.tail},
          {"held_out_error", field.held_out_error},
          {"ridge", field.ridge},
          {"branch_seconds", field.branch_seconds}};
}

nn::DType stored_as(ModeStorage storage) { return storage == ModeStorage::f16 ? nn::DType::f16 : nn::DType::f32; }

void train_modes(const ReducedArguments& arguments, const NsfConfig& config, const std::string& command_line) {
  if (!arguments.resume.empty() || arguments.time_limit > 0 || arguments.device == "cuda")
    throw ConfigError(
        "--resume, --time-limit and --device cuda are for networks (field=factored takes seconds on the CPU). Leave "
        "them out, or --set field=mlp");
  check_new_run(arguments.out);
  catch_stop_signals(StopPolicy::within_a_second);
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
                      {"calibration", json_of(report.calibration)}};
  make_folder(arguments.out);
  write_file_atomically(arguments.out + "/config.json", config_json + "\n");
  write_reduced_result(arguments, model, facts, report.seconds, Device::cpu, stored_as(config.storage));
}

int train_networks(const ReducedArguments& arguments, const NsfConfig& config, const std::string& command_line) {
  RunLog log;
  MlpTrainingOptions options;
  options.config = config;
  fill_run_options(arguments, command_line, io::write_json(io::json_of_struct(config), io::JsonLayout::compact), log,
                   options);
  MlpReport report;
  catch_stop_signals(StopPolicy::within_a_second);  // between the stages, which save what they have
  std::optional<rom::ReducedModel> model = train_mlp(options, report);
  if (!model) return stopped_run(options, "nsf");
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
  write_reduced_result(arguments, *model, facts, report.run_seconds, options.device, stored_as(config.storage));
  return 0;
}

int train(ReducedArguments arguments, const std::string& command_line) {
  if (arguments.print_defaults) {
    fmt::print("{}\n", io::commented_json(io::describe<NsfConfig>(), io::json_of_struct(NsfConfig())));
    return 0;
  }
  require_one_process("'graupel train nsf'");
  check_reduced_arguments(arguments, "scenes/recipes/nsf_sand_quick.json");
  const auto config = reduced_config<NsfConfig>(arguments);
  if (config.field == rom::FieldKind::mlp && config.stress == StressKind::law)
    throw ConfigError(
        "stress (law) is out of range with field=mlp (allowed: field), whose networks give the stress. Leave stress "
        "out, or set field=factored");
  set_num_threads(arguments.threads);
  if (config.field == rom::FieldKind::mlp) return train_networks(arguments, config, command_line);
  train_modes(arguments, config, command_line);
  return 0;
}

}  // namespace

void add_nsf_command(const Command& app, const std::string& command_line, int& exit_code) {
  auto a = std::make_shared<ReducedArguments>();
  a->out = "runs/nsf";
  const Command verb = app.command("nsf", "A reduced-order model of a parameter sweep (Neural Stress Fields)");
  add_reduced_options(verb, *a, "auto, cpu or cuda, for field=mlp");
  verb.footer(
      "Examples:\n  graupel train nsf --data data/nsf_sand_column --out runs/nsf-sand\n"
      "  graupel train nsf --data data/nsf_sand_column --set latents=5 --set storage=f16 --out runs/small\n"
      "  graupel train nsf --data data/nsf_jelly --set field=mlp --set mlp.deformation_beta=32 --time-limit 300");
  verb.callback([a, command_line, &exit_code] { exit_code = train(*a, command_line); });
}

}  // namespace graupel::train
