#include "bench/mpm/mpm_speed.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/machine/roofline.h"
#include "bench/mpm/falling_cube.h"
#include "bench/one_kind_recipe.h"
#include "core/parallel/instruction_set.h"
#include "core/system/error.h"
#include "experiments/process/process.h"
#include "mpm/scene/categories/category_scene.h"
#include "mpm/scene/scene_recipe.h"
#include "mpm/simulation.h"

namespace graupel::bench {

using namespace experiments;

double memory_bandwidth_of(Device device) {
  static std::map<std::pair<Device, int>, double> known;
  double& bandwidth = known[{device, num_threads()}];
  if (bandwidth == 0) bandwidth = memory_bandwidth(device);
  return bandwidth;
}

nlohmann::ordered_json measure_cube(const BenchMpmOptions& options, Device device, const std::string& material,
                                    int64_t particles) {
  mpm::SimulationOptions run_options;
  run_options.device = device;
  run_options.precision = options.precision == "f64" ? mpm::Precision::f64 : mpm::Precision::f32;
  run_options.kernels = options.portable ? mpm::Kernels::portable : mpm::Kernels::tuned;
  auto run = mpm::Simulation::create(cube_scene(material, cube_side(particles)), run_options);
  const bool fall = options.phase == "fall";
  const int64_t warm_up = fall ? 5 : 50, measured = fall ? 8 : 4;  // frames of 50 substeps
  for (int64_t f = 0; f < warm_up; ++f) {
    stop_if_interrupted();
    run->advance_frame();
  }
  std::vector<double> seconds;
  InstructionCounter counter;
  counter.start();
  for (int64_t f = 0; f < measured; ++f) {
    const double before = run->statistics().solver_seconds;
    run->advance_frame();
    seconds.push_back((run->statistics().solver_seconds - before) / steps_per_frame);
  }
  const auto counted = counter.stop();
  std::sort(seconds.begin(), seconds.end());
  const double median = seconds[seconds.size() / 2], n = static_cast<double>(run->particle_count());
  const auto statistics = run->statistics();
  const bool single = run_options.precision == mpm::Precision::f32;
  const double bytes = static_cast<double>(least_bytes_per_update(cube_material(material).model, single ? 4 : 8));
  nlohmann::ordered_json row = {{"material", material},
                                {"particles", run->particle_count()},
                                {"phase", options.phase},
                                {"device", name_of(device)},
                                {"precision", options.precision},
                                {"kernels", options.portable ? "portable" : "tuned"},
                                {"instruction_set", device == Device::cpu ? name_of(instruction_set()) : ""},
                                {"threads", num_threads()},
                                {"seconds_per_substep", median},
                                {"updates_per_second", n / median},
                                {"bytes_per_particle", static_cast<double>(statistics.peak_bytes) / n},
                                {"active_blocks", statistics.active_blocks},
                                {"least_bytes_per_update", bytes},
                                {"memory_share", bytes * n / median / memory_bandwidth_of(device)}};
  if (device == Device::cpu && counted) {
    row["instructions_per_update"] = counted->instructions / (n * static_cast<double>(measured * steps_per_frame));
    row["instructions_per_cycle"] = counted->instructions / counted->cycles;
  }
  return row;
}

std::vector<std::string> category_words() {
  std::vector<std::string> words;
  for (const auto& [word, category] : EnumWords<SceneCategory>::words) words.emplace_back(word);
  return words;
}

std::vector<mpm::PreparedScene> test_scenes(const BenchMpmOptions& options, Device device, mpm::Kernels kernels,
                                            const std::string& category, int64_t count) {
  std::vector<mpm::PreparedScene> scenes;
  const uint64_t seed = options.common.seed;
  const auto add = [&](const auto& recipe, int64_t i) {
    mpm::SimulationOptions simulation;
    simulation.device = device;
    simulation.kernels = kernels;
    simulation.seed = mpm::sampling_seed(seed, mpm::Split::test, i, 0);
    scenes.emplace_back(mpm::draw_scene(recipe, seed, mpm::Split::test, i), simulation);
  };
  if (category.empty()) {
    const SceneRecipe recipe = read_one_kind_recipe(options.recipe);
    for (int64_t i = 0; i < count; ++i) add(recipe, i);
    return scenes;
  }
  const CategoryRecipe recipe = io::read_category_recipe(options.recipe);
  const auto is_one = [&](SceneCategory one) { return category == word_of(one); };
  if (std::none_of(recipe.categories.begin(), recipe.categories.end(), is_one))
    throw ConfigError(
        fmt::format("'{}' has no scenes of category {}. Name one of its categories", options.recipe, category));
  for (int64_t i = 0; static_cast<int64_t>(scenes.size()) < count; ++i)
    if (is_one(recipe.category(i))) add(recipe, i);
  return scenes;
}

nlohmann::ordered_json measure_batch(const BenchMpmOptions& options, const std::vector<mpm::PreparedScene>& scenes) {
  const auto run = mpm::SceneBatch::create(scenes);
  std::vector<double> seconds;
  int64_t most_blocks = 0;
  for (int64_t f = 0; f < 5 + options.frames; ++f) {
    stop_if_interrupted();
    const double before = run->statistics().solver_seconds;
    run->advance_frame();
    if (f >= 5) seconds.push_back(run->statistics().solver_seconds - before);
    most_blocks = std::max(most_blocks, run->statistics().active_blocks);
  }
  for (int i = 0; i < run->scene_count(); ++i)
    if (const auto reason = run->divergence(i)) throw DivergedError(fmt::format("test scene {}: {}", i, *reason));
  std::sort(seconds.begin(), seconds.end());
  const double median = seconds[seconds.size() / 2], n = static_cast<double>(run->particle_count());
  const double substeps = static_cast<double>(run->statistics().substeps) / static_cast<double>(5 + options.frames);
  return {{"recipe", options.recipe},
          {"scenes", run->scene_count()},
          {"kernels", scenes.front().options.kernels == mpm::Kernels::portable ? "portable" : "tuned"},
          {"particles", run->particle_count()},
          {"frames", options.frames},
          {"substeps_per_frame", substeps},
          {"device", name_of(scenes.front().options.device)},
          {"seconds_per_frame", median},
          {"slowest_frame", seconds.back()},
          {"seconds_per_substep", median / substeps},
          {"updates_per_second", n * substeps / median},
          {"most_blocks", most_blocks}};
}

}  // namespace graupel::bench
