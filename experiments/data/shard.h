// The part of a data set that one process makes, as --shard or Slurm's variables name it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace graupel::experiments {

/// Part i of n of the scenes: every n-th, from i on.
struct Shard {
  int64_t i = 0, n = 1;
};

/// Value of an environment variable, empty where it is not set.
using EnvironmentVariable = std::function<std::optional<std::string>(const std::string& name)>;
std::optional<std::string> environment_variable(const std::string& name);

/// "I/N", or "slurm": the place of this task in its job array, by SLURM_ARRAY_TASK_ID, _COUNT, _MIN, _MAX and _STEP;
/// the lowest number of the array is shard 0, whether that is 0 or 1. Throws ConfigError for other words, outside of an
/// array, and for variables that are missing, no numbers or contradict each other.
Shard parse_shard(const std::string& text, const EnvironmentVariable& variable = environment_variable);

}  // namespace graupel::experiments
