#include "experiments/process/common_options.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/parallel/pool_limits.h"
#include "core/system/atomic_file.h"
#include "core/system/output_files.h"
#include "core/system/standard_output.h"
#include "experiments/process/json_text.h"

namespace graupel::experiments {

namespace {

/// As many as wished (0: all), or those that the system starts.
void use_threads(int wished) {
  set_num_threads(wished);
  const int wanted = num_threads(), threads = startable_threads(wanted);
  if (threads < wanted) {
    std::fprintf(stderr, "graupel: warning: the system starts %d of %d threads (ulimit -u and -v limit them)\n",
                 threads, wanted);
    set_num_threads(threads);
  }
  limit_pool(threads);
}

}  // namespace

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
  use_threads(threads);
  return parse_device(device);
}

void CommonOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file_atomically(json, json_text(result, 2) + "\n");
}

}  // namespace graupel::experiments
