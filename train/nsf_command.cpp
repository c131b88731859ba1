#include "train/nsf_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/command_line.h"
#include "core/device.h"
#include "core/error.h"
#include "core/human_time.h"
#include "io/config_description.h"
#include "train/nsf_training.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string data, out, config, json;
  std::vector<std::string> set;
  uint64_t seed = 0;
  CLI::Option* seed_option = nullptr;
  int threads = 0;
  bool print_defaults = false;
};

NsfConfig config_of(const Arguments& arguments) {
  std::vector<std::string> overrides = arguments.set;
  if (arguments.seed_option->count() > 0) overrides.push_back("seed=" + std::to_string(arguments.seed));
  const std::string text = arguments.config.empty() ? "{}" : read_file(arguments.config);
  return io::read_config<NsfConfig>(text, arguments.config.empty() ? "command line" : arguments.config, overrides);
}

Json json_of(const FieldReport& field) {
  return {
      {"modes", field.modes}, {"tail", field.tail}, {"held_out_error", field.held_out_error}, {"ridge", field.ridge}};
}

void train(const Arguments& arguments, const std::string& command_line) {
  if (arguments.print_defaults) {
    fmt::print("{}\n", io::commented_json(io::describe<NsfConfig>(), io::json_of_struct(NsfConfig())));
    return;
  }
  if (arguments.data.empty())
    throw ConfigError(
        "--data is missing. Name the folder of a sweep ('graupel generate scenes/recipes/nsf_sand_quick.json' makes "
        "one)");
  set_num_threads(arguments.threads);
  NsfTrainingOptions options;
  options.data = arguments.data;
  options.config = config_of(arguments);
  options.message = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  NsfReport report;
  const std::string config_json = io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact);
  options.provenance = {{"data", arguments.data},
                        {"command", command_line},
                        {"version", GRAUPEL_VERSION},
                        {"config", config_json},
                        {"field", "factored"}};
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
  model.provenance["training"] = facts.dump();
  make_folder(arguments.out);
  const std::string weights = arguments.out + "/weights.safetensors";
  nn::write_safetensors(weights,
                        model.store(options.config.storage == ModeStorage::f16 ? nn::DType::f16 : nn::DType::f32));
  write_file_atomically(arguments.out + "/config.json", config_json + "\n");
  write_file_atomically(arguments.out + "/report.json", facts.dump(2) + "\n");
  std::fprintf(stderr, "trained in %s (%s of it reading): %s\n", human_time(report.seconds).c_str(),
               human_time(report.read_seconds).c_str(), weights.c_str());
  if (!arguments.json.empty()) write_file_atomically(arguments.json, facts.dump(2) + "\n");
}

}  // namespace

void add_nsf_command(CLI::App& app, const std::string& command_line, int& exit_code) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("nsf", "A reduced-order model of a parameter sweep (Neural Stress Fields)");
  verb->add_option("--data", a->data, "Folder of the data set: train.h5");
  verb->add_option("--out", a->out, "Run folder")->default_val("runs/nsf");
  verb->add_option("--config", a->config, "Settings as JSON (see --print-defaults)");
  verb->add_option("--set", a->set, "Override a setting: key=value, samples=300")->take_all();
  a->seed_option = verb->add_option("--seed", a->seed, "Seed of the choice of samples");
  verb->add_option("--threads", a->threads, "CPU threads (0: all)")
      ->check(whole_number(0, 4096))
      ->capture_default_str();
  verb->add_option("--json", a->json, "Write the result as JSON to this file (-: standard output)");
  verb->add_flag("--print-defaults", a->print_defaults, "Print every setting with its default");
  verb->footer(
      "Examples:\n  graupel train nsf --data data/nsf_sand_column --out runs/nsf-sand\n"
      "  graupel train nsf --data data/nsf_sand_column --set latents=5 --set storage=f16 --out runs/small");
  verb->callback([a, command_line, &exit_code] {
    train(*a, command_line);
    exit_code = 0;
  });
}

}  // namespace graupel::train
