// What a scene needs of memory: a bound that the solvers reach, and the refusal of scenes that cannot fit.
#include "mpm/memory_need.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/parallel/memory.h"
#include "core/system/error.h"
#include "tests/mpm/kernels/fiber_backend.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::AllOf;
using testing::HasSubstr;

template <typename Call>
std::string config_error(const Call& call) {
  try {
    call();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(MemoryNeed, ParticlesAreKnownBeforeTheyAreMade) {
  Scene scene = scene_with("taichi_water", {0.3, 0.3, 0.3}, 0.1);
  Source ball = scene.sources[0];
  ball.shape = Shape::sphere;
  ball.radius = 0.08;
  ball.position = {0.6, 0.6, 0.6};
  ball.particles_per_cell = 20;
  scene.sources.push_back(ball);
  const double made = static_cast<double>(sample_sources(scene, 0).position.size());
  EXPECT_NEAR(least_memory(scene, {}).particles, made, 0.01 * made);
}

/// By areas: a thick body has no more particles there than a thin one.
TEST(MemoryNeed, ParticlesInThePlaneAreKnownToo) {
  for (const double thickness : {1e-9, 0.9}) {
    Scene scene = scene_with("taichi_water", {0.3, 0.3, 0.5}, 0.1);
    scene.domain.dimensions = 2;
    scene.sources[0].size = {0.3, 0.2, thickness};
    scene.sources[0].position[2] = scene.domain.plane();
    const double made = static_cast<double>(sample_sources(scene, 0).position.size());
    EXPECT_NEAR(least_memory(scene, {}).particles, made, 0.01 * made + 1) << thickness;
  }
}

TEST(MemoryNeed, IsWhatTheSolversReach) {
  const Scene scene = scene_with("taichi_jelly", {0.5, 0.5, 0.5}, 0.2);
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    const SimulationOptions options{.precision = precision};
    const auto run = Simulation::create(scene, options);
    const double n = static_cast<double>(run->particle_count());
    const MemoryNeed need = least_memory(scene.domain, options, n);
    const double third_copy = n * (precision == Precision::f64 ? 288 : 148);
    run->advance_frame();
    const double peak = static_cast<double>(run->statistics().peak_bytes);
    EXPECT_LE(need.host_bytes - third_copy - 4 * need.blocks, peak);  // without obstacles a directory is missing
    EXPECT_LT(peak, 1.5 * need.host_bytes);
    EXPECT_EQ(need.device_bytes, 0);
  }
  FiberBackend backend;
  std::vector<BatchEntry> entries;
  entries.push_back({scene, sample_sources(scene, 0), sparsegrid::ObstacleSet(scene)});
  BatchSolver<FiberBackend> tuned(backend, std::move(entries));
  const MemoryNeed need =
      least_memory(scene.domain, {.device = Device::cuda}, static_cast<double>(tuned.first_particle(1)));
  EXPECT_LE(need.device_bytes, static_cast<double>(tuned.memory_bytes()));
  EXPECT_GT(need.device_bytes, 0.5 * static_cast<double>(tuned.memory_bytes()));
}

TEST(MemoryNeed, TheErrorNamesBothFiguresTheParticlesAndARemedy) {
  constexpr uint64_t plenty = std::numeric_limits<uint64_t>::max();
  MemoryNeed need{.particles = 1000000, .blocks = 5000, .host_bytes = 4.5e9};
  EXPECT_NO_THROW(check_memory(need, 4500000000, 0));
  EXPECT_THAT(
      config_error([&] { check_memory(need, 4499999999, plenty); }),
      AllOf(HasSubstr("memory of the CPU"), HasSubstr("4.5 GB needed for 1000000 particles and 5000 grid blocks"),
            HasSubstr("4.5 GB available"), HasSubstr("fewer particles_per_cell, a larger dx")));
  need.device_bytes = 3e9;
  EXPECT_THAT(config_error([&] { check_memory(need, plenty, 2000000000); }),
              AllOf(HasSubstr("memory of the GPU"), HasSubstr("3 GB needed"), HasSubstr("2 GB available")));
  need.particles = 3e9;
  EXPECT_THAT(config_error([&] { check_memory(need, plenty, plenty); }),
              AllOf(HasSubstr("too many particles (3000000000"), HasSubstr("allowed: 2147483631")));
}

TEST(MemoryNeed, ScenesThatCannotFitAreRefusedAtOnce) {
  Scene fine = scene_with("taichi_water", {0.5, 0.5, 0.5}, 0.5);
  fine.sources[0].particles_per_cell = 1000;
  fine.domain.dx = 1e-4;  // 1.25e14 particles
  fine.domain.size = {1, 1, 1};
  EXPECT_THAT(config_error([&] { Simulation::create(fine, {}); }), HasSubstr("too many grid blocks"));
  fine.domain.dx = 1.0 / 2048;  // 1e12 particles
  EXPECT_THAT(config_error([&] { Simulation::create(fine, {}); }),
              AllOf(HasSubstr("does not fit into the memory of the CPU"), HasSubstr("GB available")));
  Scene empty = scene_with("taichi_water");
  empty.domain.size = {1000, 1000, 1000};
  EXPECT_THAT(config_error([&] { Simulation::create(empty, {}); }),
              AllOf(HasSubstr("too many grid blocks"), HasSubstr("larger dx or a smaller domain")));
}

TEST(MemoryNeed, ALargeEmptyDomainWorks) {
  Scene scene = scene_with("taichi_water", {10, 10, 10}, 0.08);
  scene.domain.size = {20, 20, 20};
  scene.time_step.substeps_per_frame = 2;
  scene.frame_time = 2 * 3e-4;
  const auto run = Simulation::create(scene, {});
  run->advance_frame();
  EXPECT_EQ(run->statistics().substeps, 2);
}

TEST(MemoryNeed, RunawayEmittersAreRefusedAtOnce) {
  Scene scene = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.05);
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.1, 0.1, 0.1};
  emitter.position = {0.5, 0.8, 0.5};
  emitter.material = "taichi_water";
  emitter.velocity = {0, -5, 0};
  emitter.end_time = 1e6;
  scene.emitters.push_back(emitter);
  EXPECT_THAT(config_error([&] { Simulation::create(scene, {}); }),
              AllOf(HasSubstr("emitter 0 (/emitters/0"), HasSubstr("particle_limit: 1000000"),
                    HasSubstr("end the emission earlier")));
  constexpr int64_t most = 2'000'000'000;  // that the key takes
  scene.emitters[0].particle_limit = most;
  const double a_second = 0.1 * 0.1 * 5 * 8 / std::pow(scene.domain.dx, 3);
  scene.emitters[0].end_time = 0.95 * static_cast<double>(most) / a_second;
  if (available_bytes(Device::cpu) > 400'000'000'000) return;  // they fit
  EXPECT_THAT(config_error([&] { Simulation::create(scene, {}); }),
              AllOf(HasSubstr("emitter 0 (/emitters/0"), HasSubstr("more particles than fit into memory"),
                    HasSubstr("GB available")));
}

}  // namespace
}  // namespace graupel::mpm
