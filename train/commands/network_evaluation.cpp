// graupel-train hgn|gns --evaluate: one-step errors of a weights file.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "train/commands/network_command.h"
#include "train/commands/run_log.h"
#include "train/commands/run_outputs.h"
#include "train/parallel/rank_environment.h"

namespace graupel::train {

using Json = nlohmann::ordered_json;

namespace {

Json json_of(const SquaredErrors& errors) {
  Json json = {{"particles", errors.particles}};
  for (const Predictor predictor : all_predictors) {
    json["raw_mse"][name_of(predictor)] = errors.raw_mse(predictor);
    json["normalized_mse"][name_of(predictor)] = errors.normalized_mse(predictor);
  }
  return json;
}

}  // namespace

Json json_of(const OneStepErrors& errors) {
  Json json = {{"samples", errors.samples}, {"all", json_of(errors.all())}};
  for (const Region region : all_regions)
    json[name_of(region)] = json_of(errors.region[static_cast<std::size_t>(region)]);
  return json;
}

void evaluate_network(const NetworkArguments& arguments) {
  require_one_process("--evaluate");
  if (arguments.data.empty()) throw ConfigError("--data is missing. Name the folder of the data set");
  if (says_how_to_train(arguments) || !arguments.resume.empty() || !arguments.out.empty() || arguments.minutes > 0 ||
      arguments.stop_step > 0)
    throw ConfigError(
        "--evaluate trains nothing (--preset, --config, --set, --steps, --from, --teacher, --seed, --resume, --out, "
        "--minutes and --stop-step are for training). Leave them out");
  check_data_folder(arguments.data);
  const std::string split_file = arguments.data + "/" + arguments.split + ".h5";
  check_run_outputs({{"the weights", arguments.evaluate}, {"the data", split_file}}, "", arguments.json);
  const Device device = device_for_torch(arguments.device);
  configure_torch(num_threads(), /*tf32=*/true);
  const nn::Weights weights = nn::read_safetensors(arguments.evaluate);
  const NetworkConfig config = network_config_of(weights);
  if (architecture_of(config) != arguments.architecture)
    throw InputError(fmt::format("'{}' holds another network (architecture '{}', needed '{}'). Use graupel train {}",
                                 arguments.evaluate, word_of(architecture_of(config)), word_of(arguments.architecture),
                                 word_of(architecture_of(config))));
  const graph::Normalization normalization = graph::read_normalization(weights);
  NetworkModule module(config, device, 0);
  module.set_state(StateArray::weights, weights);

  DataSplitOptions split_options;
  split_options.threads = num_threads();
  split_options.materials = features_of(config).material_constants;
  split_options.check = [&](const DataSplit& opened) {
    opened.check_fits(config, arguments.evaluate);
    opened.check_samples(1, 0);
  };
  const DataSplit split(split_file, split_options);
  const OneStepErrors errors =
      evaluate_one_step(module, normalization, split, strided_samples(split, arguments.stride),
                        {.which = StateArray::weights, .batch_scenes = 16, .threads = num_threads()});
  fmt::print("one-step error of the acceleration, normalised (raw [m^2/frame^4])\n{:14} {:>10} {:>22} {:>22} {:>22}\n",
             "region", "particles", "network", "zero", "ballistic");
  const auto row = [](const char* name, const SquaredErrors& e) {
    const auto cell = [&](Predictor p) { return fmt::format("{:.4g} ({:.3e})", e.normalized_mse(p), e.raw_mse(p)); };
    fmt::print("{:14} {:>10} {:>22} {:>22} {:>22}\n", name, e.particles, cell(Predictor::network),
               cell(Predictor::zero), cell(Predictor::ballistic));
  };
  row("all", errors.all());
  for (const Region region : all_regions) row(name_of(region), errors.region[static_cast<std::size_t>(region)]);
  Json json = json_of(errors);
  json["weights"] = arguments.evaluate;
  json["split"] = split.file();
  if (!arguments.json.empty()) write_file_atomically(arguments.json, json.dump(2) + "\n");
}

}  // namespace graupel::train
