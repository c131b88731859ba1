// Flags that every verb takes.
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
  /// Sets the number of threads; returns the device. Throws ConfigError, and IoError when --json cannot be written.
  Device apply();
  /// Writes `result` to --json, if given ("-": standard output).
  void write_json(const nlohmann::ordered_json& result) const;
};

}  // namespace graupel::experiments
