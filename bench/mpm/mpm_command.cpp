// graupel bench mpm: speed of the material point method, whole substeps, after a warm-up: on a falling cube, or on a
// batch of a recipe's scenes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/machine/roofline.h"
#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/parallel/instruction_set.h"
#include "core/system/error.h"
#include "experiments/process/process.h"
#include "io/scene/recipe_reader.h"
#include "mpm/scene/scene_recipe.h"
#include "mpm/simulation.h"

namespace graupel::bench {

using namespace experiments;

namespace {

constexpr int64_t steps_per_frame = 50;
constexpr double step = 1e-4;  ///< [s]

struct BenchMpmOptions {
  CommonOptions common;
  std::string material = "all", phase = "fall", precision = "f32";
  std::vector<int64_t> particles = {39304};
  std::string recipe;
  std::vector<int64_t> batch = {1};
  int64_t frames = 60;
  bool portable = false;
  std::string table;
};

/// "tait_water", or the word of a constitutive model that moves.
std::vector<std::string> material_words() {
  std::vector<std::string> words = {"all", "tait_water"};
  for (const auto& [word, model] : EnumWords<MaterialModel>::words)
    if (model != MaterialModel::stationary) words.emplace_back(word);
  return words;
}

MaterialConfig cube_material(const std::string& name) {
  const bool tait = name == "tait_water";
  const auto taichi = material_preset(tait ? "taichi_water" : "taichi_" + name);
  MaterialConfig m = taichi ? *taichi : *material_preset(name);
  m.name = name;
  if (tait) {
    m.equation_of_state = EquationOfState::tait;
    m.tait_exponent = 7.15;
    m.viscosity = 0.01;
  }
  m.density = 1000;
  m.youngs_modulus = name == "jelly" ? 5e4 : 1e5;
  m.poissons_ratio = name == "jelly" ? 0.4 : 0.3;
  m.friction_angle = 30;
  m.bulk_modulus = 4e4;
  m.yield_stress = 1000;
  m.consistency = 10;
  return m;
}

/// A cube of `cells` cells a side with 8 jittered particles a cell, 6 cells above the floor.
Scene cube_scene(const std::string& material, int64_t cells) {
  Scene scene;
  scene.name = material;
  scene.domain.dx = 1.0 / 256;
  const double dx = scene.domain.dx, side = static_cast<double>(cells) * dx;
  scene.domain.size = Vec3d::filled(std::max(1.0, side + 64 * dx));
  scene.materials[material] = cube_material(material);
  Source source;
  source.material = material;
  source.sampling = Sampling::jittered_lattice;
  source.size = {side, side, side};
  const double middle = scene.domain.size[0] / 2;
  source.position = {middle, static_cast<double>(scene.domain.wall_cells + 6) * dx + side / 2, middle};
  scene.sources.push_back(source);
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = steps_per_frame;
  scene.frame_time = static_cast<double>(steps_per_frame) * step;
  return scene;
}

std::vector<std::string> materials_of(const BenchMpmOptions& options) {
  if (options.material == "all") return {"water", "jelly", "snow", "sand"};
  return {options.material};
}

/// Cells a side whose particles come closest to `particles`.
int64_t cube_side(int64_t particles) {
  return std::max<int64_t>(1, std::llround(std::cbrt(static_cast<double>(particles) / 8)));
}

/// memory_bandwidth() of the present number of threads, measured once.
double memory_bandwidth_of(Device device) {
  static std::map<std::pair<Device, int>, double> known;
  double& bandwidth = known[{device, num_threads()}];
  if (bandwidth == 0) bandwidth = memory_bandwidth(device);
  return bandwidth;
}

nlohmann::ordered_json measure(const BenchMpmOptions& options, Device device, const std::string& material,
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

/// The first `batch` test scenes of a recipe at once: every frame's time after the first five.
nlohmann::ordered_json measure_batch(const BenchMpmOptions& options, Device device, int64_t batch) {
  const SceneRecipe recipe = io::read_recipe(options.recipe);
  std::vector<mpm::PreparedScene> scenes;
  for (int64_t i = 0; i < batch; ++i) {
    mpm::SimulationOptions simulation;
    simulation.device = device;
    simulation.seed = mpm::sampling_seed(options.common.seed, mpm::Split::test, i, 0);
    scenes.emplace_back(mpm::draw_scene(recipe, options.common.seed, mpm::Split::test, i), simulation);
  }
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
          {"scenes", batch},
          {"particles", run->particle_count()},
          {"frames", options.frames},
          {"substeps_per_frame", substeps},
          {"device", name_of(device)},
          {"seconds_per_frame", median},
          {"slowest_frame", seconds.back()},
          {"seconds_per_substep", median / substeps},
          {"updates_per_second", n * substeps / median},
          {"most_blocks", most_blocks}};
}

void bench_recipe(BenchMpmOptions& options) {
  const Device device = options.common.apply();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%7s %11s %10s %10s %14s %14s\n", "scenes", "particles", "ms/frame", "slowest", "us/substep",
              "G updates/s");
  for (const int64_t batch : options.batch) {
    const auto row = measure_batch(options, device, batch);
    std::printf("%7lld %11lld %10.3f %10.3f %14.2f %14.4f\n", static_cast<long long>(batch),
                row["particles"].get<long long>(), 1e3 * row["seconds_per_frame"].get<double>(),
                1e3 * row["slowest_frame"].get<double>(), 1e6 * row["seconds_per_substep"].get<double>(),
                1e-9 * row["updates_per_second"].get<double>());
    std::fflush(stdout);
    rows.push_back(row);
  }
  options.common.write_json({{"rows", rows}});
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
          const auto row = measure(options, device, material, particles);
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

/// A GPU beside the set-up of docs/performance.md: thousand millions of particle-updates a second, falling and late.
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
        const auto row = measure(options, device, material, particles);
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

void bench_mpm(BenchMpmOptions& options) {
  if (!options.recipe.empty()) return bench_recipe(options);
  if (options.table == "cpu") return bench_cpu_table(options);
  if (options.table == "cuda") return bench_cuda_table(options);
  const Device device = options.common.apply();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%-8s %-5s %11s %14s %14s %12s\n", "material", "phase", "particles", "us/substep", "G updates/s",
              "B/particle");
  for (const int64_t particles : options.particles)
    for (const std::string& material : materials_of(options)) {
      const auto row = measure(options, device, material, particles);
      std::printf("%-8s %-5s %11lld %14.2f %14.4f %12.0f\n", material.c_str(), options.phase.c_str(),
                  row["particles"].get<long long>(), 1e6 * row["seconds_per_substep"].get<double>(),
                  1e-9 * row["updates_per_second"].get<double>(), row["bytes_per_particle"].get<double>());
      std::fflush(stdout);
      rows.push_back(row);
    }
  options.common.write_json({{"rows", rows}});
}

}  // namespace

void add_bench(CLI::App& app) {
  CLI::App* bench = app.add_subcommand("bench", "Measure speed, and agreement with theory");
  bench->require_subcommand(1);
  auto options = std::make_shared<BenchMpmOptions>();
  CLI::App* verb = bench->add_subcommand("mpm", "Whole substeps of a falling cube: dx = 1/256 m, steps of 1e-4 s");
  verb->add_option("--material", options->material,
                   "A constitutive model, tait_water (exponent 7.15, viscous), or all: water, jelly, snow and sand")
      ->check(CLI::IsMember(material_words()))
      ->capture_default_str();
  verb->add_option("--particles", options->particles, "Number of particles (8 a cell of a cube; repeatable)")
      ->check(CLI::Range(int64_t{8}, int64_t{100000000}))
      ->capture_default_str();
  verb->add_option("--phase", options->phase, "fall: substeps 250-650; late: 2500-2700, on the floor")
      ->check(CLI::IsMember({"fall", "late"}))
      ->capture_default_str();
  verb->add_option("--precision", options->precision, "f32 or f64 (CPU)")
      ->check(CLI::IsMember({"f32", "f64"}))
      ->capture_default_str();
  verb->add_option("--recipe", options->recipe, "Instead of the cube: test scenes of a recipe, all at once");
  verb->add_option("--batch", options->batch, "With --recipe: number of scenes (repeatable)")
      ->check(CLI::Range(int64_t{1}, int64_t{100000}))
      ->capture_default_str();
  verb->add_option("--frames", options->frames, "With --recipe: frames to measure, after five more")
      ->check(CLI::Range(int64_t{1}, int64_t{100000}))
      ->capture_default_str();
  verb->add_option("--table", options->table,
                   "Instead, one table. cpu: f32 and f64 on one thread and on all; cuda: falling and late")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->excludes("--recipe");
  verb->add_flag("--portable", options->portable, "The portable kernels instead of the tuned ones");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel bench mpm --material sand --particles 1000000 --device cuda\n"
      "  graupel bench mpm --particles 39304 --phase late --threads 1 --json speed.json\n"
      "  graupel bench mpm --table cpu --particles 100000 --json cpu.json\n"
      "  graupel bench mpm --table cuda --particles 4096 39304 262144 1000000 10077696 --json gpu.json\n"
      "  graupel bench mpm --recipe scenes/recipes/hgn.json --batch 1 64 --device cuda");
  verb->callback([options] { bench_mpm(*options); });
  add_bench_graph(*bench);
  add_bench_rom(*bench);
  add_bench_validate(*bench);
}

}  // namespace graupel::bench
