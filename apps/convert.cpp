// graupel convert: data sets of other programs by tools/convert.py, weights to smaller numbers, scenes with every key.
#include <cstdio>
#include <utility>

#include "apps/verbs.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/process/common_options.h"
#include "experiments/process/python_tool.h"
#include "io/scene/scene_reader.h"
#include "nn/number_width.h"

namespace graupel::apps {

using namespace experiments;

namespace {

/// Throws ConfigError where --numbers is missing or a number does not fit.
void convert_weights(const std::string& input, const std::string& output, const std::string& numbers,
                     const std::vector<std::string>& keep) {
  if (numbers.empty())
    throw ConfigError("'" + input + "' holds weights, which need --numbers (allowed: f32, f16, bf16, i8). Give one");
  nn::Weights weights = nn::read_safetensors(input);
  nn::set_number_width(weights, numbers, keep);
  nn::write_safetensors(output, weights);
  std::fprintf(stderr, "%s: %zu tensors in %s\n", output.c_str(), weights.tensors.size(), numbers.c_str());
}

/// A file of weights or a scene.
void convert_file(std::vector<std::string> words) {
  CommandLine flags("Convert a file", "graupel convert");
  std::string input, output, numbers;
  std::vector<std::string> changes, keep;
  CommonOptions common;
  flags.option("input", input, "").required();
  flags.option("output", output, "").required();
  flags.option("--numbers", numbers, "").check(one_of({"f32", "f16", "bf16", "i8"}));
  flags.option("--keep", keep, "").delimiter(',');
  flags.option("--set", changes, "").one_value_each();
  common.add_to(flags);
  flags.parse(std::move(words));
  common.apply();
  if (input.ends_with(".safetensors"))
    convert_weights(input, output, numbers, keep);
  else
    write_file_atomically(output, io::scene_to_json(io::read_scene(input, changes)));
}

}  // namespace

void add_convert(const Command& app) {
  const Command verb = app.command("convert", "Convert data sets: ours, geoelements/gns, LagrangeBench; weights");
  verb.take_words_as_they_are();  // the tool reads the flags, --help among them
  verb.callback([verb] {
    const std::vector<std::string> words = verb.words();
    const auto is_file = [](const std::string& w) { return w.ends_with(".safetensors") || w.ends_with(".json"); };
    !words.empty() && is_file(words.front()) ? convert_file(words) : become_python_tool("convert.py", words);
  });
}

}  // namespace graupel::apps
