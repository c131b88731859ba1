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

}  // namespace graupel::bench
