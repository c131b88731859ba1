#include "experiments/process/common_options.h"

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/output_files.h"
#include "core/system/standard_output.h"

namespace graupel::experiments {

void CommonOptions::add_to(const Command& verb) {
  verb.option("--seed", seed, "Seed of all random numbers").remember_in(seed_given);
  verb.option("--device", device, "auto, cpu or cuda").suggest({"auto", "cpu", "cuda"}).show_default();
  add_without_run_to(verb);
}

void CommonOptions::add_without_run_to(const Command& verb) {
  verb.option("--threads", threads, "CPU threads (0: all)").check(whole_number(0, 4096)).show_default();
  verb.option("--json", json, "Write the result as JSON to this file (-: standard output)").names_file({".json"});
}

Device CommonOptions::apply() {
  check_output_file(json);
  if (json == "-") reserve_standard_output();
  set_num_threads(threads);
  return parse_device(device);
}

void CommonOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file_atomically(json, result.dump(2) + "\n");
}

}  // namespace graupel::experiments
