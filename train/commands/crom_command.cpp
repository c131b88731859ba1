#include "train/commands/crom_command.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "core/system/stop_signal.h"
#include "train/commands/reduced_command.h"
#include "train/parallel/rank_environment.h"
#include "train/reduced/crom/crom_training.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

Json json_of(const ReconstructionErrors& errors) {
  return {{"position", errors.position},
          {"displacement", errors.displacement},
          {"gradient", errors.gradient},
          {"velocity", errors.velocity}};
}

int train(ReducedArguments arguments, const std::string& command_line) {
  if (arguments.print_defaults) {
    fmt::print("{}\n", io::commented_json(io::describe<CromConfig>(), io::json_of_struct(CromConfig())));
    return 0;
  }
  require_one_process("'graupel train crom'");
  check_reduced_arguments(arguments, "scenes/recipes/crom_gravity.json");
  RunLog log;
  CromTrainingOptions options;
  options.config = reduced_config<CromConfig>(arguments);
  set_num_threads(arguments.threads);
  fill_run_options(arguments, command_line, io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact),
                   log, options);
  CromReport report;
  catch_stop_signals(StopPolicy::within_a_second);  // but within the training's steps, which saves what it has
  std::optional<rom::ReducedModel> model = train_crom(options, report);
  if (!model) return stopped_run(options, "crom");
  Json facts = {{"snapshots", report.snapshots},
                {"seconds", report.seconds},
                {"read_seconds", report.read_seconds},
                {"latent_tail", report.latent_tail},
                {"device", name_of(options.device)},
                {"steps", report.steps},
                {"loss", report.loss},
                {"training_errors", json_of(report.training)}};
  facts["calibration"] = json_of(report.calibration);
  if (report.test) facts["test_errors"] = json_of(*report.test);
  write_reduced_result(arguments, *model, facts, report.run_seconds, options.device, nn::DType::f32);
  return 0;
}

}  // namespace

void add_crom_command(const Command& app, const std::string& command_line, int& exit_code) {
  auto a = std::make_shared<ReducedArguments>();
  a->out = "runs/crom";
  const Command verb = app.command("crom", "A reduced-order model of the deformation alone (CROM)");
  add_reduced_options(verb, *a, "auto, cpu or cuda");
  verb.footer(
      "Examples:\n  graupel train crom --data data/crom_gravity --out runs/crom-gravity\n"
      "  graupel train crom --data data/crom_torsion --set latents=7 --time-limit 300");
  verb.callback([a, command_line, &exit_code] { exit_code = train(*a, command_line); });
}

}  // namespace graupel::train
