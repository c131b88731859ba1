// graupel convert: data sets of learned simulators from one format to another, weights to smaller numbers.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/verbs.h"
#include "core/command_line.h"
#include "core/error.h"
#include "experiments/process.h"
#include "experiments/progress.h"
#include "io/data_set_conversion.h"
#include "nn/weights.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct ConvertOptions {
  CommonOptions common;
  std::string input, output, format = "graupel", types, numbers;
  std::vector<std::string> splits, set;
  std::optional<double> connectivity_radius;
};

io::DataSetFormat format_named(const std::string& word) {
  for (const auto& [name, format] : EnumWords<io::DataSetFormat>::words)
    if (word == name) return format;
  throw ConfigError("--format '" + word + "' is not known (allowed: graupel, gns, lagrangebench). Use one of these");
}

nlohmann::ordered_json result_json(const ConvertOptions& options, const io::ConversionResult& result) {
  nlohmann::ordered_json splits;
  for (const auto& [name, split] : result.splits)
    splits[name] = {{"trajectories", split.trajectories},
                    {"most_frames", split.most_frames},
                    {"most_particles", split.most_particles}};
  return {{"output", options.output},
          {"from", word_of(result.from)},
          {"format", options.format},
          {"splits", splits},
          {"trajectories_whose_obstacles_are_left_out", result.with_obstacles}};
}

std::string split_list(const io::ConversionResult& result) {
  std::string text;
  for (const char* name : io::split_names)
    if (const auto found = result.splits.find(name); found != result.splits.end())
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", found->second.trajectories, name);
  return text;
}

/// The settings of `graupel train` that must be those of the data, and those that go with their radius as the defaults
/// with 0.035 m.
std::string training_settings(const io::ConversionResult& result, std::string_view network) {
  const Scene& scene = *result.scene;
  const double radius = result.connectivity_radius;
  std::string text =
      fmt::format(" --set {0}.frame_time={1} --set {0}.dx={2} --set {0}.{3}={4} --set {0}.wall_clamp={5}", network,
                  scene.frame_time, scene.domain.dx, network == "gns" ? "radius" : "spacing", radius, 8 * radius);
  if (scene.domain.is_plane()) text += fmt::format(" --set {}.dimensions=2", network);
  return text;
}

void convert_data(ConvertOptions& options) {
  if (!options.numbers.empty())
    throw ConfigError("--numbers is for weights ('" + options.input + "' is not a .safetensors file). Leave it out");
  std::optional<Progress> progress;
  io::ConversionOptions job;
  job.input = options.input;
  job.output = options.output;
  job.format = format_named(options.format);
  job.types = options.types;
  job.splits = options.splits;
  job.set = options.set;
  job.connectivity_radius = options.connectivity_radius;
  job.made_by = version_text();
  job.progress = [&](int64_t done, int64_t total) {
    stop_if_interrupted("; nothing was written");
    if (!progress) progress.emplace("convert", total);
    progress->update(done);
  };
  const io::ConversionResult result = io::convert_data_set(job);
  if (progress) progress->done();
  std::fprintf(stderr, "%s: %s trajectories, %s to %s\n", options.output.c_str(), split_list(result).c_str(),
               word_of(result.from), options.format.c_str());
  if (result.with_obstacles > 0)
    std::fprintf(stderr, "convert: the obstacles of %lld trajectories are left out (%s knows them as particles only)\n",
                 static_cast<long long>(result.with_obstacles), options.format.c_str());
  if (result.scene)
    for (const char* network : {"hgn", "gns"})
      std::fprintf(stderr, "Train by: graupel train %s --data %s%s\n", network, options.output.c_str(),
                   training_settings(result, network).c_str());
  options.common.write_json(result_json(options, result));
}

/// Every tensor of floats in numbers of another size. Throws ConfigError where a number does not fit.
void convert_weights(const ConvertOptions& options) {
  const std::map<std::string, nn::DType> types = {
      {"f32", nn::DType::f32}, {"f16", nn::DType::f16}, {"bf16", nn::DType::bf16}};
  const auto type = types.find(options.numbers);
  if (type == types.end())
    throw ConfigError("'" + options.input +
                      "' holds weights, which need --numbers (allowed: f32, f16, bf16). Give one");
  nn::Weights weights = nn::read_safetensors(options.input);
  for (auto& [name, tensor] : weights.tensors) {
    if (tensor.dtype == nn::DType::i64 || tensor.dtype == nn::DType::i32 || tensor.dtype == nn::DType::u8) continue;
    tensor = nn::Tensor::from_float(tensor.as_float(), tensor.shape, type->second);
    for (const float value : tensor.as_float())
      if (!std::isfinite(value))
        throw ConfigError("tensor '" + name + "' of '" + options.input + "' has a number that " + options.numbers +
                          " cannot hold. Use --numbers bf16 or f32");
  }
  nn::write_safetensors(options.output, weights);
  std::fprintf(stderr, "%s: %zu tensors in %s\n", options.output.c_str(), weights.tensors.size(),
               options.numbers.c_str());
}

}  // namespace

void add_convert(CLI::App& app) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* verb =
      app.add_subcommand("convert", "Convert data sets: ours, geoelements/gns, LagrangeBench; shorten weights");
  verb->add_option("input", options->input, "Folder of a data set; its files say which format it has. Or weights")
      ->required();
  verb->add_option("output", options->output, "Folder, or file of weights, to make")->required();
  verb->add_option("-f,--format", options->format, "Format of the output: graupel, gns (.npz) or lagrangebench (.h5)")
      ->check(CLI::IsMember({"graupel", "gns", "lagrangebench"}))
      ->capture_default_str();
  verb->add_option("--types", options->types,
                   "Particle types of the other program: NUMBER=MATERIAL,..., or NUMBER=obstacle; the rest as below");
  verb->add_option("--split", options->splits, "Convert these alone: train,valid,test (default: all there are)")
      ->check(CLI::IsMember({"train", "valid", "test"}))
      ->delimiter(',')
      ->allow_extra_args(false);
  verb->add_option("--set", options->set,
                   "Change a key of the scenes that are made: --set gravity=[0,-9.8,0] --set domain.dx=0.02")
      ->allow_extra_args(false);
  verb->add_option("--connectivity-radius", options->connectivity_radius,
                   "Written to metadata.json for graph networks [m]; default the input's")
      ->check(real_number(LowerBound::above_zero));
  verb->add_option("--numbers", options->numbers, "Of weights: f32, f16 or bf16")
      ->check(CLI::IsMember({"f32", "f16", "bf16"}));
  options->common.add_to(*verb);
  verb->footer(
      "Positions keep their bits. Types: gns 3 obstacle, 4 jelly, 5 water, 6 sand, 7 toothpaste (goop), 8 snow;\n"
      "lagrangebench 0 water, 1 obstacle (wall), 2 stationary (moving wall), 4 jelly, 6 sand, 7 toothpaste, 8 snow.\n"
      "Other programs' data have no scene: walls come from their bounds, gravity is 0 unless --set says otherwise.\n"
      "Their pickles are never executed. The output appears when all of it is written.\n\nExamples:\n"
      "  graupel convert data/hgn data/hgn-gns --format gns\n"
      "  graupel convert WaterDropSample data/water --set gravity=[0,-9.8,0]\n"
      "  graupel convert 3D_LDC_8160_10kevery100 data/ldc --types 2=obstacle --split train,valid\n"
      "  graupel convert runs/hgn/weights.safetensors models/hgn.safetensors --numbers f16");
  verb->callback([options] {
    options->common.apply();
    options->input.ends_with(".safetensors") ? convert_weights(*options) : convert_data(*options);
  });
}

}  // namespace graupel::apps
