#include "train/commands/run_outputs.h"

#include "io/trajectory/input_files.h"

namespace graupel::train {

void check_run_outputs(const std::vector<NamedFile>& inputs, const std::string& run, const std::string& json) {
  check_output_file(json);
  std::vector<NamedFile> outputs = {{"--json", json}};
  if (!run.empty())
    for (const char* name : {"config.json", "run.json", "command.txt", "log.txt", "normalization.safetensors",
                             "weights.safetensors", "report.json"})
      outputs.push_back({std::string("the run's ") + name, run + "/" + name});
  io::check_inputs_kept(inputs, outputs);
}

}  // namespace graupel::train
