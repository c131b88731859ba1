#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/math/random.h"
#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "mpm/particles/state_bytes.h"
#include "mpm/particles/state_check.h"
#include "mpm/scene/scene_hash.h"
#include "mpm/simulation.h"
#include "tests/gpu_only.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::mpm {
namespace {

Scene falling() {
  Scene scene = scene_with("taichi_snow", {0.5, 0.12, 0.5});
  add_box(scene, "taichi_sand", {0.55, 0.2, 0.5});
  scene.time_step.policy = StepPolicy::adaptive;
  for (Source& source : scene.sources) source.velocity = {0.3, -2, 0};
  return scene;
}

class SavedState : public testing::TestWithParam<Precision> {};

TEST_P(SavedState, ARestartedRunEqualsAnUninterruptedOneByteForByte) {
  const Scene scene = falling();
  const SimulationOptions options{.precision = GetParam()};
  const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
             second = Simulation::create(scene, options);
  for (int f = 0; f < 4; ++f) whole->advance_frame();
  for (int f = 0; f < 2; ++f) first->advance_frame();
  second->advance_frame();  // restoring replaces whatever the run did before
  second->load_state(first->save_state());
  EXPECT_EQ(second->time(), first->time());
  for (int f = 0; f < 2; ++f) second->advance_frame();
  EXPECT_TRUE(second->save_state() == whole->save_state());
  EXPECT_EQ(second->statistics().substeps, whole->statistics().substeps);
}

/// The number of threads is no part of the state.
TEST_P(SavedState, AnyNumberOfThreadsGoesOn) {
  const Scene scene = falling();
  const SimulationOptions options{.precision = GetParam()};
  const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
             second = Simulation::create(scene, options);
  set_num_threads(1);
  for (int f = 0; f < 3; ++f) whole->advance_frame();
  first->advance_frame();
  set_num_threads(2);
  second->load_state(first->save_state());
  for (int f = 0; f < 2; ++f) second->advance_frame();
  set_num_threads(0);
  EXPECT_TRUE(second->save_state() == whole->save_state());
}

TEST_P(SavedState, SoDoRunsInThePlaneAndWithCubicSplines) {
  for (const int dimensions : {2, 3})
    for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
      Scene scene = dimensions == 2 ? in_the_plane(falling()) : falling();
      scene.transfer.spline = spline;
      const SimulationOptions options{.precision = GetParam()};
      const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
                 second = Simulation::create(scene, options);
      for (int f = 0; f < 4; ++f) whole->advance_frame();
      for (int f = 0; f < 2; ++f) first->advance_frame();
      second->load_state(first->save_state());
      for (int f = 0; f < 2; ++f) second->advance_frame();
      EXPECT_TRUE(second->save_state() == whole->save_state()) << dimensions << word_of(spline);
    }
}

INSTANTIATE_TEST_SUITE_P(BothPrecisions, SavedState, testing::Values(Precision::f32, Precision::f64));

/// All that a run may have beside its particles: emitters, sinks, gates, scripts, loads, moving obstacles.
TEST_P(SavedState, SoDoesOneWithEmittersSinksScriptsLoadsAndMovingObstacles) {
  Scene scene = falling();
  Emitter emitter;
  emitter.size = {0.06, 0.02, 0.06};
  emitter.position = {0.3, 0.5, 0.5};
  emitter.material = "taichi_sand";
  emitter.velocity = {0, -1, 0};
  scene.emitters.push_back(emitter);
  Sink sink;
  sink.position = {0.55, 0.12, 0.5};
  scene.sinks.push_back(sink);
  for (const double start : {0.0, 2.5, 3.0, 4.5}) {
    TimedLoad load;
    load.start = start * scene.frame_time;
    load.duration = 2 * scene.frame_time;
    load.place = {0.5, 0.12, 0.5};
    load.radius = 0.06;
    load.force = {0.5, 2, 0};
    scene.loads.push_back(load);
  }
  scene.gravity_keyframes = {{2 * scene.frame_time, {0, -5, 0}}, {5 * scene.frame_time, {0, -12, 1}}};
  KinematicRegion region;
  region.position = {0.5, 0.12, 0.5};
  region.size = {0.04, 0.2, 0.2};
  region.motion.velocity = {0, 0.1, 0};
  region.motion.end_time = 1;
  region.release_time = 0.05;
  scene.kinematic_regions.push_back(region);
  Obstacle plate;
  plate.size = {0.1, 0.05, 0.1};
  plate.position = {0.3, 0.4, 0.5};
  plate.motion = Motion{};
  plate.motion->spin = 1;
  scene.obstacles.push_back(plate);
  const WallConfig periodic{.kind = Wall::periodic, .friction = {}};
  scene.domain.faces.z_low = scene.domain.faces.z_high = periodic;
  scene.transfer = {TransferScheme::rpic, 3};
  const SimulationOptions options{.precision = GetParam()};
  const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
             second = Simulation::create(scene, options);
  for (int f = 0; f < 6; ++f) whole->advance_frame();
  for (int f = 0; f < 3; ++f) first->advance_frame();
  second->load_state(first->save_state());
  for (int f = 0; f < 3; ++f) second->advance_frame();
  EXPECT_TRUE(second->save_state() == whole->save_state());
  EXPECT_EQ(second->frame().active, whole->frame().active);
  EXPECT_GT(whole->statistics().born, 0);
  EXPECT_GT(whole->statistics().removed, 0);
  EXPECT_EQ(second->statistics().load_momentum, whole->statistics().load_momentum);
  EXPECT_EQ(whole->statistics().loads_without_carriers, 0);
}

void expect_same_after_a_restart_on_the_gpu(const Scene& scene) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    const SimulationOptions options{.device = Device::cuda, .kernels = kernels};
    const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
               second = Simulation::create(scene, options);
    for (int f = 0; f < 4; ++f) whole->advance_frame();
    for (int f = 0; f < 2; ++f) first->advance_frame();
    second->load_state(first->save_state());
    EXPECT_EQ(second->time(), first->time());
    for (int f = 0; f < 2; ++f) second->advance_frame();
    EXPECT_TRUE(second->save_state() == whole->save_state());
    EXPECT_EQ(second->frame().position, whole->frame().position);
    EXPECT_THROW(Simulation::create(scene, {})->load_state(first->save_state()), InputError);
  }
}

TEST(SavedStateOnTheGpu, ARestartedRunEqualsAnUninterruptedOneByteForByte) {
  GRAUPEL_NEEDS_GPU();
  expect_same_after_a_restart_on_the_gpu(falling());
}

TEST(SavedStateOnTheGpu, ARestartedRunOfASceneThatChangesEqualsAnUninterruptedOneByteForByte) {
  GRAUPEL_NEEDS_GPU();
  for (const auto& [name, scene] : changing_scenes()) expect_same_after_a_restart_on_the_gpu(scene);
}

std::string input_error(Simulation& sim, const std::vector<std::byte>& state) {
  try {
    sim.load_state(state);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// What a stranger's file may hold: a right checksum over wrong bytes. Refused, diverged or run, but nothing else.
TEST(SavedStateErrors, AnyBytesWithARightChecksumDoNoHarm) {
  const Scene scene = emitter_and_sink();
  const auto run = Simulation::create(scene, {});
  run->advance_frame();
  const std::vector<std::byte> state = run->save_state();
  const Random random(5, RandomPurpose::test);
  int refused = 0;
  constexpr uint64_t mutants = 300;
  for (uint64_t k = 0; k < mutants; ++k) {
    std::vector<std::byte> bytes = state;
    const std::size_t content = bytes.size() - sizeof(uint64_t);
    const auto first = static_cast<std::size_t>(random.uniform(k, 0, 32.0, static_cast<double>(content - 16)));
    const auto length = static_cast<std::size_t>(random.uniform(k, 1, 1.0, 16.0));
    for (std::size_t j = 0; j < length; ++j)
      bytes[first + j] = static_cast<std::byte>(random.uniform((k << 8) + j, 2, 0.0, 255.9));
    const uint64_t checksum = fnv1a(fnv_start, bytes.data(), content);
    std::memcpy(bytes.data() + content, &checksum, sizeof(checksum));
    try {
      run->load_state(bytes);
      run->advance_frame();
      static_cast<void>(run->frame());
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
  run->load_state(state);  // and none of it is left
  run->advance_frame();
}

TEST(SavedStateErrors, ParticlesThatNoRunLeavesAreRefused) {
  constexpr int32_t materials = 2;
  HostParticles<float> good(3);
  for (std::size_t i = 0; i < good.size(); ++i) {
    good.position[i] = {0.1f, 0.2f, 0.3f};
    good.velocity[i] = Vec3f::zero();
    good.internal[i] = good.volume[i] = 1;
    good.material[i] = 1;
    good.source_index[i] = 2 - static_cast<int32_t>(i);
  }
  const auto error = [&](const auto& change, std::vector<Presence> presence = {}) -> std::string {
    HostParticles<float> p = good;
    change(p);
    try {
      check_state(p, presence, materials, Domain());
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  const auto nothing = [](HostParticles<float>&) {};
  EXPECT_EQ(error(nothing), "");
  EXPECT_THAT(error([](auto& p) { p.material[1] = 2; }), testing::HasSubstr("(slot 1: material 2 of 2)"));
  EXPECT_THAT(error([](auto& p) { p.source_index[2] = 1; }), testing::HasSubstr("particle 1, there are 3, once each"));
  EXPECT_THAT(error([](auto& p) { p.position[0][1] = 1e30f; }), testing::HasSubstr("outside of the domain"));
  constexpr float inf = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error([](auto& p) { p.deformation_gradient[2](1, 2) = -inf; }), testing::HasSubstr("not finite"));
  EXPECT_THAT(error([](auto& p) { p.stress[2].a[5] = std::nanf(""); }), testing::HasSubstr("not finite"));
  EXPECT_THAT(error([](auto& p) { p.internal[2] = inf; }), testing::HasSubstr("not finite"));
  EXPECT_THAT(error([](auto& p) { p.volume[2] = -1; }), testing::HasSubstr("a volume that is not above 0"));
  const std::vector<Presence> gone(3, Presence::gone);
  EXPECT_EQ(error([](auto& p) { p.position[0][1] = 1e30f; }, gone), "") << "where it left";
  EXPECT_THAT(error(nothing, std::vector<Presence>(3, static_cast<Presence>(3))), testing::HasSubstr("presence 3"));
}

TEST(SavedStateErrors, ForeignOrDamagedStatesAreRefused) {
  const Scene scene = falling();
  const auto sim = Simulation::create(scene, {}), twin = Simulation::create(scene, {.precision = Precision::f64}),
             seeded = Simulation::create(scene, {.seed = 4});
  const std::vector<std::byte> state = sim->save_state();
  EXPECT_EQ(input_error(*sim, state), "");
  EXPECT_THAT(input_error(*twin, state), testing::HasSubstr("32 bits"));
  EXPECT_THAT(input_error(*seeded, state), testing::HasSubstr("another scene or seed"));

  Scene other = scene;
  other.materials["taichi_snow"].hardening = 9;
  EXPECT_THAT(input_error(*Simulation::create(other, {}), state), testing::HasSubstr("another scene"));
  other = scene;
  other.transfer.spline = Spline::cubic;
  EXPECT_THAT(input_error(*Simulation::create(other, {}), state), testing::HasSubstr("another scene"));
  const Scene plane = in_the_plane(scene);
  EXPECT_THAT(input_error(*Simulation::create(plane, {}), state), testing::HasSubstr("another scene"));
  Scene longer = scene;
  longer.frames += 100;
  longer.name = "renamed";
  EXPECT_EQ(input_error(*Simulation::create(longer, {}), state), "");

  const auto n = static_cast<int64_t>(sim->particle_count());
  const std::vector<std::byte> gpu = StateWriter({scene_hash(scene, 0), SolverKind::gpu_tuned, 4, n}, 0).finish();
  EXPECT_THAT(input_error(*sim, gpu),
              testing::HasSubstr("a run on a GPU with the tuned kernels, this run is on the CPU"));

  std::vector<std::byte> damaged = state;
  damaged[state.size() / 2] ^= std::byte{1};
  EXPECT_THAT(input_error(*sim, damaged), testing::HasSubstr("damaged"));
  damaged = state;
  damaged.pop_back();
  EXPECT_THAT(input_error(*sim, damaged), testing::HasSubstr("damaged"));
  EXPECT_THAT(input_error(*sim, {}), testing::HasSubstr("too short"));
  damaged = state;
  damaged[0] ^= std::byte{1};
  EXPECT_THAT(input_error(*sim, damaged), testing::HasSubstr("not a saved state"));
}

/// Kernels for whole tiles look up the materials of the last tile's spare lanes too.
TEST(SavedStateErrors, IndicesBehindTheLastParticleAreRefused) {
  const Scene scene = scene_with("taichi_sand", {0.4, 0.1, 0.4}, 0.04);
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  const auto n = static_cast<int64_t>(sim->particle_count());
  ASSERT_NE(n % tile, 0);
  std::vector<std::byte> state = sim->save_state();
  const std::size_t content = state.size() - sizeof(uint64_t);
  const auto indices = static_cast<std::size_t>(padded_to_tile(n)) * sizeof(int32_t);
  for (const std::size_t behind : {content - sizeof(int32_t), content - indices - sizeof(int32_t)}) {
    std::vector<std::byte> changed = state;
    changed[behind] = std::byte{77};
    const uint64_t checksum = fnv1a(fnv_start, changed.data(), content);
    std::memcpy(changed.data() + content, &checksum, sizeof(checksum));
    EXPECT_THAT(input_error(*sim, changed), testing::HasSubstr("indices behind the last particle"));
  }
}

}  // namespace
}  // namespace graupel::mpm
