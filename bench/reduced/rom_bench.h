// A reduced-order model on the runs of a split of its data set: error, trust, speed, and answers that need no model.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::bench {

using namespace experiments;

struct BenchRomOptions {
  CommonOptions common;
  std::string model, data, split = "test", plot;
  std::vector<std::string> from, against;
  std::vector<double> step_factors;
  std::vector<int64_t> samples = {0};
  int64_t cluster = 0;
  std::string rule = "spread";
  std::vector<double> box;
  std::optional<int> iterations;
  std::optional<double> manifold_pull;
  std::string projection, quadrature;  ///< empty: the model's
  double outlier_factor = 0;           ///< removed; 0 alone is allowed
  bool f64 = false, other_scene = false, keep_steps = false;
  int64_t instances = 1;
};

/// Measures every run with every number of samples and step factor, prints a row for each, and with --device cuda the
/// steps of many runs at once. Throws InputError and ConfigError as LoadedModel and measure_rom.
nlohmann::ordered_json run_rom_bench(const BenchRomOptions& options);

}  // namespace graupel::bench
