#include "experiments/data/shard.h"

#include <charconv>
#include <cstdio>
#include <cstdlib>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

constexpr int64_t largest_number = int64_t{1} << 32;

int64_t array_number(const EnvironmentVariable& variable, const std::string& part, int64_t low,
                     std::optional<int64_t> otherwise = std::nullopt) {
  const std::string name = "SLURM_ARRAY_TASK_" + part;
  const auto text = variable(name);
  if (!text && otherwise) return *otherwise;
  if (!text)
    throw ConfigError("environment variable " + name +
                      " is missing (SLURM_ARRAY_TASK_ID is set, so that this is a task of a Slurm array). Name the "
                      "part: --shard I/N");
  int64_t value = -1;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (error != std::errc() || end != text->data() + text->size() || value < low || value > largest_number)
    throw ConfigError("environment variable " + name + "='" + *text + "' is not usable (allowed: a whole number, " +
                      std::to_string(low) + " to " + std::to_string(largest_number) +
                      "). Slurm sets it in job arrays; elsewhere name the part: --shard I/N");
  return value;
}

Shard shard_of_array(const EnvironmentVariable& variable) {
  if (!variable("SLURM_ARRAY_TASK_ID"))
    throw ConfigError(
        "--shard slurm needs a task of a Slurm array (SLURM_ARRAY_TASK_ID is not set). Submit with sbatch --array=0-7, "
        "or name the part: --shard I/N");
  const int64_t id = array_number(variable, "ID", 0), low = array_number(variable, "MIN", 0),
                high = array_number(variable, "MAX", low), step = array_number(variable, "STEP", 1, 1);
  const int64_t count = array_number(variable, "COUNT", 1);
  const Shard shard = {(id - low) / step, count};
  const bool even = (count - 1) * step == high - low && (id - low) % step == 0;
  if (!even || id < low || shard.i >= shard.n)
    throw ConfigError("task " + std::to_string(id) + " of the Slurm array has no place among its " +
                      std::to_string(count) + " tasks (numbers " + std::to_string(low) + " to " + std::to_string(high) +
                      ", step " + std::to_string(step) +
                      "; allowed: evenly spaced numbers). Submit with --array=0-7, or name the part: --shard I/N");
  std::fprintf(stderr, "generate: task %lld of the Slurm array %lld-%lld makes shard %lld/%lld\n",
               static_cast<long long>(id), static_cast<long long>(low), static_cast<long long>(high),
               static_cast<long long>(shard.i), static_cast<long long>(shard.n));
  return shard;
}

}  // namespace

std::optional<std::string> environment_variable(const std::string& name) {
  const char* const value = std::getenv(name.c_str());
  return value == nullptr ? std::nullopt : std::optional<std::string>(value);
}

Shard parse_shard(const std::string& text, const EnvironmentVariable& variable) {
  if (text == "slurm") return shard_of_array(variable);
  char tail = 0;
  long long i = 0, n = 0;
  if (std::sscanf(text.c_str(), "%lld/%lld%c", &i, &n, &tail) != 2 || n < 1 || i < 0 || i >= n)
    throw ConfigError("--shard '" + text + "' is not I/N with 0 <= I < N, and not 'slurm'. Example: --shard 2/8");
  return {i, n};
}

}  // namespace graupel::experiments
