// Speed of the material point method in whole substeps, after a warm-up: of a falling cube, or of a batch of scenes.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"
#include "mpm/simulation.h"

namespace graupel::bench {

using namespace experiments;

struct BenchMpmOptions {
  CommonOptions common;
  std::string material = "all", phase = "fall", precision = "f32";
  std::vector<int64_t> particles = {39304};
  std::string recipe;
  std::vector<std::string> categories;
  std::vector<int64_t> batch = {1};
  int64_t frames = 60;
  bool portable = false;
  std::string table;
};

/// Bytes that the device's memory moves in a second, by the present number of threads; measured once.
double memory_bandwidth_of(Device device);
/// One cube: median time of a substep, updates a second, share of the memory's bandwidth; on the CPU instructions.
nlohmann::ordered_json measure_cube(const BenchMpmOptions& options, Device device, const std::string& material,
                                    int64_t particles);
/// The words of the categories of recipes.
std::vector<std::string> category_words();
/// Test scenes of a recipe, the first `count` (of a category, where the recipe has some).
std::vector<mpm::PreparedScene> test_scenes(const BenchMpmOptions& options, Device device, mpm::Kernels kernels,
                                            const std::string& category, int64_t count);
/// Scenes of a recipe at once: every frame's time after the first five. Throws DivergedError where one diverges.
nlohmann::ordered_json measure_batch(const BenchMpmOptions& options, const std::vector<mpm::PreparedScene>& scenes);

}  // namespace graupel::bench
