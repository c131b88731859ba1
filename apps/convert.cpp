// graupel convert: data sets of other programs by tools/convert.py, weights to smaller numbers, scenes with every key.
#include <algorithm>
#include <utility>

#include "apps/verbs.h"
#include "experiments/process/convert_file.h"
#include "experiments/process/python_tool.h"

namespace graupel::apps {

using namespace experiments;

namespace {

/// Words after "--" are files, also those that begin with a dash.
std::vector<std::string> with_plain_files(std::vector<std::string> words) {
  const auto mark = std::find(words.begin(), words.end(), "--");
  if (mark == words.end()) return words;
  for (auto word = words.erase(mark); word != words.end(); ++word)
    if (word->starts_with('-')) word->insert(0, "./");
  return words;
}

/// A file of weights or a scene.
void convert_one(std::vector<std::string> words) {
  CommandLine flags("Convert a file", "graupel convert");
  FileConversion file;
  flags.option("input", file.input, "").names_file().required();
  flags.option("output", file.output, "").names_file().required();
  flags.option("--numbers", file.numbers, "").check(one_of({"f32", "f16", "bf16", "i8"}));
  flags.option("--keep", file.keep, "").delimiter(',');
  flags.option("--set", file.set, "").one_value_each();
  file.common.add_without_run_to(flags);
  flags.parse(std::move(words));
  convert_file(file);
}

}  // namespace

void add_convert(const Command& app) {
  const Command verb = app.command("convert", "Convert data sets: ours, geoelements/gns, LagrangeBench; weights");
  verb.take_words_as_they_are();  // the tool reads the flags, --help among them
  verb.callback([verb] {
    const std::vector<std::string> words = with_plain_files(verb.words());
    const auto is_file = [](const std::string& w) { return w.ends_with(".safetensors") || w.ends_with(".json"); };
    !words.empty() && is_file(words.front()) ? convert_one(words) : become_python_tool("convert.py", words);
  });
}

}  // namespace graupel::apps
