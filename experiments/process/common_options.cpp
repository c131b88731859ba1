#include "experiments/process/common_options.h"

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "experiments/process/outputs.h"

namespace graupel::experiments {

void CommonOptions::add_to(CLI::App& verb) {
  verb.add_option("--seed", seed, "Seed of all random numbers")->each([this](const std::string&) {
    seed_given = true;
  });
  verb.add_option("--device", device, "auto, cpu or cuda")->capture_default_str();
  verb.add_option("--threads", threads, "CPU threads (0: all)")->check(whole_number(0, 4096))->capture_default_str();
  verb.add_option("--json", json, "Write the result as JSON to this file (-: standard output)");
}

Device CommonOptions::apply() {
  check_output_file(json);
  set_num_threads(threads);
  return parse_device(device);
}

void CommonOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file_atomically(json, result.dump(2) + "\n");
}

}  // namespace graupel::experiments
