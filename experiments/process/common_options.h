// Flags that verbs have in common.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/parallel/device.h"
#include "core/system/command_line.h"

namespace graupel::experiments {

struct CommonOptions {
  uint64_t seed = 0;
  bool seed_given = false;
  std::string device = "auto";
  int threads = 0;
  std::string json;

  /// Adds --seed, --device, --threads, --json to a verb.
  void add_to(const Command& verb);
  /// Adds --threads and --json alone, to a verb that runs nothing.
  void add_without_run_to(const Command& verb);
  /// Sets the number of threads; returns the device. Where --json is "-" it is alone on standard output, and what is
  /// printed goes to standard error. Throws ConfigError, and IoError when --json cannot be written.
  Device apply();
  /// Writes `result` to --json, if given ("-": standard output).
  void write_json(const nlohmann::ordered_json& result) const;
};

}  // namespace graupel::experiments
