// graupel convert: data sets of other programs by tools/convert.py, weights to smaller numbers, scenes with every key.
#include <algorithm>
#include <cstdio>

#include "experiments/process/common_options.h"
#include "experiments/process/python_tool.h"
#include "apps/verbs.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "nn/number_width.h"

namespace graupel::apps {

namespace {

/// Throws ConfigError where --numbers is missing or a number does not fit.
void convert_weights(const std::string& input, const std::string& output, const std::string& numbers) {
  if (numbers.empty())
    throw ConfigError("'" + input + "' holds weights, which need --numbers (allowed: f32, f16, bf16). Give one");
  nn::Weights weights = nn::read_safetensors(input);
  nn::set_number_width(weights, numbers);
  nn::write_safetensors(output, weights);
  std::fprintf(stderr, "%s: %zu tensors in %s\n", output.c_str(), weights.tensors.size(), numbers.c_str());
}

/// A file of weights or a scene.
void convert_file(std::vector<std::string> words) {
  CLI::App flags("Convert a file", "graupel convert");
  std::string input, output, numbers;
  std::vector<std::string> changes;
  CommonOptions common;
  flags.add_option("input", input)->required();
  flags.add_option("output", output)->required();
  flags.add_option("--numbers", numbers)->check(CLI::IsMember({"f32", "f16", "bf16"}));
  flags.add_option("--set", changes)->allow_extra_args(false);
  common.add_to(flags);
  std::reverse(words.begin(), words.end());
  flags.parse(words);
  common.apply();
  if (input.ends_with(".safetensors"))
    convert_weights(input, output, numbers);
  else
    write_file_atomically(output, io::scene_to_json(io::read_scene(input, changes)));
}

}  // namespace

void add_convert(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("convert", "Convert data sets: ours, geoelements/gns, LagrangeBench; weights");
  verb->prefix_command();  // the tool reads the flags, --help among them
  verb->set_help_flag();
  verb->callback([verb] {
    const std::vector<std::string> words = verb->remaining();
    const auto is_file = [](const std::string& w) { return w.ends_with(".safetensors") || w.ends_with(".json"); };
    !words.empty() && is_file(words.front()) ? convert_file(words) : become_python_tool("convert.py", words);
  });
}

}  // namespace graupel::apps
