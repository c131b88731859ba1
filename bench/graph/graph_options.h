// What 'graupel-bench graph' measures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::bench {

using namespace experiments;

struct BenchGraphOptions {
  CommonOptions common;
  std::vector<std::string> models = {"mpm", "mpm:fast", "mpm:coarse", "models/hgn.safetensors"};
  std::vector<int64_t> particles = {3600};
  std::string recipe = "scenes/recipes/hgn.json";
  int64_t frames = 30, settle = 150;
  std::vector<int64_t> batch = {};  ///< scenes at once
  bool libtorch = false;
};

}  // namespace graupel::bench
