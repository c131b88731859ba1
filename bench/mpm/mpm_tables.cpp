#include "bench/mpm/mpm_tables.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/parallel/instruction_set.h"
#include "core/system/error.h"
#include "experiments/process/process.h"
#include "io/trajectory/input_files.h"

namespace graupel::bench {

using namespace experiments;

namespace {

std::vector<std::string> materials_of(const BenchMpmOptions& options) {
  if (options.material == "all") return {"water", "jelly", "snow", "sand"};
  return {options.material};
}

void bench_recipe(BenchMpmOptions& options) {
  const Device device = options.common.apply();
  const mpm::Kernels kernels = options.portable ? mpm::Kernels::portable : mpm::Kernels::tuned;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%7s %11s %10s %10s %14s %14s\n", "scenes", "particles", "ms/frame", "slowest", "us/substep",
              "G updates/s");
  for (const int64_t batch : options.batch) {
    const auto row = measure_batch(options, test_scenes(options, device, kernels, "", batch));
    std::printf("%7lld %11lld %10.3f %10.3f %14.2f %14.4f\n", static_cast<long long>(batch),
                row["particles"].get<long long>(), 1e3 * row["seconds_per_frame"].get<double>(),
                1e3 * row["slowest_frame"].get<double>(), 1e6 * row["seconds_per_substep"].get<double>(),
                1e-9 * row["updates_per_second"].get<double>());
    std::fflush(stdout);
    rows.push_back(row);
  }
  options.common.write_json({{"rows", rows}});
}

/// Scenes of categories: the tuned kernels beside the portable ones.
void bench_categories(BenchMpmOptions& options) {
  const Device device = options.common.apply();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%-17s %7s %11s %14s %14s %14s\n", "category", "scenes", "particles", "tuned ms/frame", "portable",
              "portable/tuned");
  for (const std::string& category : options.categories)
    for (const int64_t batch : options.batch) {
      double seconds[2];
      for (const mpm::Kernels kernels : {mpm::Kernels::tuned, mpm::Kernels::portable}) {
        auto row = measure_batch(options, test_scenes(options, device, kernels, category, batch));
        row["category"] = category;
        seconds[kernels == mpm::Kernels::portable ? 1 : 0] = row["seconds_per_frame"].get<double>();
        rows.push_back(row);
      }
      std::printf("%-17s %7lld %11lld %14.3f %14.3f %14.2f\n", category.c_str(), static_cast<long long>(batch),
                  rows.back()["particles"].get<long long>(), 1e3 * seconds[0], 1e3 * seconds[1],
                  seconds[1] / seconds[0]);
      std::fflush(stdout);
    }
  options.common.write_json({{"command", command_line()}, {"rows", rows}});
}

/// All materials in both precisions on one thread and on all: millions of particle-updates a second.
void bench_cpu_table(BenchMpmOptions& options) {
  if (options.common.device == "cuda")
    throw ConfigError("--table cpu measures the CPU (--device cuda, allowed: auto, cpu). Leave out --device");
  options.common.device = "cpu";
  const Device device = options.common.apply();
  const int all = num_threads();
  std::vector<int> threads = {1};
  if (all > 1) threads.push_back(all);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%s\n%-8s %-5s %11s %-9s", name_of(instruction_set()), "material", "phase", "particles", "precision");
  for (const int n : threads) std::printf(" %6d %s", n, n == 1 ? "thread " : "threads");
  std::printf("  [M updates/s]\n");
  for (const int64_t particles : options.particles)
    for (const std::string& material : materials_of(options))
      for (const char* precision : {"f32", "f64"}) {
        options.precision = precision;
        for (const int n : threads) {
          set_num_threads(n);
          const auto row = measure_cube(options, device, material, particles);
          if (n == 1)
            std::printf("%-8s %-5s %11lld %-9s", material.c_str(), options.phase.c_str(),
                        row["particles"].get<long long>(), precision);
          std::printf(" %14.2f", 1e-6 * row["updates_per_second"].get<double>());
          std::fflush(stdout);
          rows.push_back(row);
        }
        std::printf("\n");
      }
  set_num_threads(all);
  options.common.write_json({{"command", command_line()}, {"rows", rows}});
}

/// A GPU beside the set-up of docs/lab/performance.md: G particle-updates a second, falling and late.
void bench_cuda_table(BenchMpmOptions& options) {
  options.common.device = "cuda";
  const Device device = options.common.apply();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf(
      "%s, %.2f TB/s; G updates/s, share of the memory's peak that the state alone takes\n%-10s %11s %10s %8s %10s "
      "%8s\n",
      cuda_device_name().c_str(), 1e-12 * memory_bandwidth_of(device), "material", "particles", "fall", "", "late", "");
  for (const int64_t particles : options.particles)
    for (const std::string& material : materials_of(options)) {
      std::printf("%-10s", material.c_str());
      for (const char* phase : {"fall", "late"}) {
        options.phase = phase;
        const auto row = measure_cube(options, device, material, particles);
        if (options.phase == "fall") std::printf(" %11lld", row["particles"].get<long long>());
        std::printf(" %10.4f %6.1f %%", 1e-9 * row["updates_per_second"].get<double>(),
                    100 * row["memory_share"].get<double>());
        std::fflush(stdout);
        rows.push_back(row);
      }
      std::printf("\n");
    }
  options.common.write_json({{"command", command_line()}, {"gpu", cuda_device_name()}, {"rows", rows}});
}

}  // namespace

void print_mpm_table(BenchMpmOptions& options) {
  if (!options.categories.empty() && options.recipe.empty())
    throw ConfigError("--category needs a recipe of categories. Name one with --recipe (scenes/recipes/general.json)");
  io::check_inputs_kept({{"the recipe", options.recipe}}, {{"--json", options.common.json}});
  if (!options.categories.empty()) return bench_categories(options);
  if (!options.recipe.empty()) return bench_recipe(options);
  if (options.table == "cpu") return bench_cpu_table(options);
  if (options.table == "cuda") return bench_cuda_table(options);
  const Device device = options.common.apply();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%-8s %-5s %11s %14s %14s %12s\n", "material", "phase", "particles", "us/substep", "G updates/s",
              "B/particle");
  for (const int64_t particles : options.particles)
    for (const std::string& material : materials_of(options)) {
      const auto row = measure_cube(options, device, material, particles);
      std::printf("%-8s %-5s %11lld %14.2f %14.4f %12.0f\n", material.c_str(), options.phase.c_str(),
                  row["particles"].get<long long>(), 1e6 * row["seconds_per_substep"].get<double>(),
                  1e-9 * row["updates_per_second"].get<double>(), row["bytes_per_particle"].get<double>());
      std::fflush(stdout);
      rows.push_back(row);
    }
  options.common.write_json({{"rows", rows}});
}

}  // namespace graupel::bench
