#include "experiments/data/generate.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

Shard parse_shard(const std::string& text) {
  Shard shard;
  char tail = 0;
  long long i = 0, n = 0;
  if (std::sscanf(text.c_str(), "%lld/%lld%c", &i, &n, &tail) != 2 || n < 1 || i < 0 || i >= n)
    throw ConfigError("--shard '" + text + "' is not I/N with 0 <= I < N. Example: --shard 2/8");
  shard.i = i;
  shard.n = n;
  return shard;
}

}  // namespace

void generate(GenerateOptions& options) {
  options.set.device = options.common.apply();
  options.set.shard = parse_shard(options.shard);
  options.scenes.seed = options.common.seed;
  options.scenes.seed_given = options.common.seed_given;
  const auto scenes = open_recipe(options.scenes);
  options.common.write_json(make_data_set(*scenes, options.set));
}

}  // namespace graupel::experiments
