// Short benchmarks of the solver and of a network, and the median that both print.
#pragma once

#include <algorithm>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/parallel/device.h"

namespace graupel::bench {

inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

/// Falling cubes of each material at several sizes: whole-substep time, particle-updates per second.
nlohmann::ordered_json run_mpm(Device device, const std::vector<int64_t>& cells_per_side);
/// The shipped network on a shared scene: time of a frame by part, beside the rate of a plain matrix product.
nlohmann::ordered_json run_hgn(const std::string& weights, const std::string& scene);

}  // namespace graupel::bench
