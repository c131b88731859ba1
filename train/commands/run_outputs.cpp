#include "train/commands/run_outputs.h"

#include <filesystem>

#include "core/system/error.h"
#include "io/trajectory/input_files.h"

namespace graupel::train {

namespace {

bool is_same_folder(const std::string& a, const std::string& b) {
  std::error_code code;  // where one is not there, they are not the same
  return std::filesystem::is_directory(a, code) && std::filesystem::equivalent(a, b, code);
}

}  // namespace

void check_data_folder(const std::string& data) {
  std::error_code code;
  if (std::filesystem::is_regular_file(data, code))
    throw ConfigError("--data must name a folder ('" + data + "' is a file). Name the folder that it is in");
}

void check_run_outputs(const std::vector<NamedFile>& inputs, const std::string& run, const std::string& json) {
  check_output_file(json);
  std::error_code code;
  if (!run.empty() && std::filesystem::exists(run, code) && !std::filesystem::is_directory(run, code))
    throw IoError("the run cannot be written to '" + run + "' (it is a file). Name a folder");
  check_output_folder(run);
  std::vector<NamedFile> outputs = {{"--json", json}};
  if (!run.empty())
    for (const char* name : {"config.json", "run.json", "command.txt", "log.txt", "normalization.safetensors",
                             "weights.safetensors", "report.json"})
      outputs.push_back({std::string("the run's ") + name, run + "/" + name});
  io::check_inputs_kept(inputs, outputs);
  for (const NamedFile& input : inputs)
    if (!run.empty() && is_same_folder(input.file, run))
      throw ConfigError("the run would be written into " + input.name + ", '" + input.file + "'. Choose another --out");
}

}  // namespace graupel::train
