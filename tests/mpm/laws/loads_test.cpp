// Loads and gravity that changes: the laws of motion of bodies under them, and who carries a load.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/system/error.h"
#include "mpm/solver/solver.h"
#include "tests/gpu_only.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

const Vec3d center = {0.5, 0.5, 0.5};

TimedLoad load_at(const Vec3d& place, double radius, const Vec3d& force, double start, double duration) {
  TimedLoad load;
  load.place = place;
  load.radius = radius;
  load.force = force;
  load.start = start;
  load.duration = duration;
  return load;
}

/// A block of jelly in the middle of the domain, without gravity; 20 steps a frame.
Scene free_block() {
  Scene scene = scene_with("jelly", center);
  scene.gravity = {0, 0, 0};
  set_steps(scene, 20, 2e-4);
  return scene;
}

/// A run in f64 whose particles can be read in f64.
struct ExactRun {
  explicit ExactRun(const Scene& scene, const SimulationOptions& options = {.precision = Precision::f64})
      : prepared(scene, options), solver(scene, options, prepared.particles, prepared.obstacles) {}
  void frames(int n) {
    for (int f = 0; f < n; ++f) solver.advance_frame();
  }
  /// Of the particles [first, end) in the order of the sources, which all have one mass.
  Vec3d mean_position(int32_t first = 0, int32_t end = 1 << 30) const {
    return mean(solver.particles().position, first, end);
  }
  Vec3d mean_velocity(int32_t first = 0, int32_t end = 1 << 30) const {
    return mean(solver.particles().velocity, first, end);
  }
  Vec3d mean(const std::vector<Vec3d>& values, int32_t first, int32_t end) const {
    const HostParticles<double> host = solver.particles();
    Vec3d sum = {0, 0, 0};
    double count = 0;
    for (std::size_t i = 0; i < host.size(); ++i) {
      if (host.source_index[i] < first || host.source_index[i] >= end) continue;
      sum += values[i];
      ++count;
    }
    return (1 / count) * sum;
  }
  PreparedScene prepared;
  Solver<double> solver;
};

/// Of a body of which a part carries the load, from and to times within steps.
void expect_impulse(Scene scene, const SimulationOptions& options, double tolerance) {
  const Vec3d force = {0.3, 0.2, scene.domain.is_plane() ? 0.0 : -0.1};
  const double step = scene.frame_time / 20;
  scene.loads = {load_at({0.5, 0.53, 0.5}, 0.03, force, 7.4 * step, 20.3 * step)};
  const auto run = Simulation::create(scene, options);
  const Diagnostics before = run->diagnostics();
  for (int f = 0; f < 2; ++f) run->advance_frame();
  const Diagnostics after = run->diagnostics();
  const Vec3d impulse = scene.loads[0].duration * force;
  const double scale = tolerance * norm(impulse);
  EXPECT_LT(norm(after.momentum - before.momentum - impulse), scale);
  EXPECT_LT(norm(run->statistics().load_momentum - impulse), scale);
  EXPECT_EQ(run->statistics().loads_without_carriers, 0);
}

TEST(Loads, TheMomentumGainedIsTheForceTimesTheDuration) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    for (const TransferScheme scheme : {TransferScheme::apic, TransferScheme::pic, TransferScheme::rpic}) {
      Scene scene = free_block();
      scene.transfer.scheme = scheme;
      expect_impulse(scene, {.precision = Precision::f64, .kernels = kernels}, 1e-12);
      expect_impulse(scene, {.precision = Precision::f32, .kernels = kernels}, 1e-4);
    }
    for (const StepPolicy policy : {StepPolicy::adaptive, StepPolicy::per_frame}) {
      Scene scene = free_block();
      scene.time_step.policy = policy;
      expect_impulse(scene, {.precision = Precision::f64, .kernels = kernels}, 1e-12);
    }
  }
}

TEST(Loads, SoItIsInThePlaneWithCubicSplinesAndInEveryInstructionSet) {
  Scene cubic = free_block();
  cubic.transfer.spline = Spline::cubic;
  for (const Scene& scene : {cubic, in_the_plane(free_block()), in_the_plane(cubic)}) {
    expect_impulse(scene, {.precision = Precision::f64}, 1e-12);
    expect_impulse(scene, {.precision = Precision::f32}, 1e-4);
  }
  for (const InstructionSet set : available_instruction_sets())
    expect_impulse(free_block(), {.precision = Precision::f64, .instruction_set = set}, 1e-12);
}

TEST(Loads, OnTheGpuToo) {
  GRAUPEL_NEEDS_GPU();
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable})
    expect_impulse(free_block(), {.device = Device::cuda, .kernels = kernels}, 1e-4);
}

/// The centre of mass moves as under F / m, whether all of the body carries the force or a part of it. The solver's
/// motion is symplectic Euler: after n steps F / m dt^2 n (n + 1) / 2.
TEST(Loads, AFreeBodysCentreMovesAsForceOverMass) {
  for (const double radius : {1.0, 0.03}) {
    Scene scene = free_block();
    const Vec3d force = {0.5, 0.2, -0.1};
    scene.loads = {load_at(center, radius, force, 0, 1)};
    ExactRun run(scene);
    const Vec3d start = run.mean_position(), a = (1 / run.solver.diagnostics().mass) * force;
    run.frames(5);
    const double n = 100, dt = scene.frame_time / 20;
    EXPECT_LT(norm(run.mean_velocity() - n * dt * a), 1e-13 * norm(n * dt * a)) << radius;
    const Vec3d way = (dt * dt * n * (n + 1) / 2) * a;
    EXPECT_LT(norm(run.mean_position() - start - way), 5e-15) << radius;
    EXPECT_GT(norm(way), 1e-4);
  }
}

/// Also where the body then lies on the floor.
TEST(Loads, ALoadThatEqualsGravityIsGravityOnTheGrid) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    const SimulationOptions options{.precision = Precision::f64, .kernels = kernels};
    Scene by_gravity = free_block();
    by_gravity.sources[0].position[1] = by_gravity.wall_low()[1] + 0.041;
    by_gravity.gravity = {1, -9.8, 0};
    Scene by_load = by_gravity;
    by_load.gravity = {0, 0, 0};
    ExactRun first(by_gravity, options);
    by_load.loads = {load_at(center, 1, first.solver.diagnostics().mass * by_gravity.gravity, 0, 1)};
    ExactRun second(by_load, options);
    for (ExactRun* run : {&first, &second}) run->frames(5);
    const HostParticles<double> a = first.solver.particles(), b = second.solver.particles();
    ASSERT_EQ(a.source_index, b.source_index);
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_LT(norm(a.position[i] - b.position[i]), 1e-12);
    EXPECT_GT(norm(first.mean_velocity()), 0.01);
  }
}

/// g(t) = g0 + s t: v = g0 t + s t^2 / 2 after every step, and x = dt sum of these.
TEST(GravityPath, AFallIsTheIntegralOfThePath) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    Scene scene = free_block();
    const Vec3d g0 = {0, -3, 0}, g1 = {2, 1, -4};
    scene.gravity = g0;
    scene.gravity_keyframes = {{5 * scene.frame_time, g1}};
    ExactRun run(scene, {.precision = Precision::f64, .kernels = kernels});
    const Vec3d start = run.mean_position();
    run.frames(5);
    const double n = 100, dt = scene.frame_time / 20, end = n * dt;
    const Vec3d slope = (1 / end) * (g1 - g0);
    EXPECT_LT(norm(run.mean_velocity() - end * g0 - (end * end / 2) * slope), 5e-15);
    const Vec3d way = (dt * dt * n * (n + 1) / 2) * g0 + (dt * dt * dt * n * (n + 1) * (2 * n + 1) / 12) * slope;
    EXPECT_LT(norm(run.mean_position() - start - way), 5e-15);
    const Vec3d continuous = (end * end / 2) * g0 + (end * end * end / 6) * slope;
    EXPECT_LT(norm(way - continuous), dt * end * 3);
    run.frames(5);
    EXPECT_LT(norm(run.mean_velocity() - (end / 2) * (g0 + g1) - end * g1), 5e-15) << "it stays after the last key";
  }
}

TEST(GravityPath, OfOneValueIsConstantGravityToTheByte) {
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    Scene scene = four_materials();
    const auto constant = Simulation::create(scene, {.precision = precision});
    scene.gravity_keyframes = {{1, scene.gravity}};
    const auto path = Simulation::create(scene, {.precision = precision});
    for (int f = 0; f < 2; ++f) {
      constant->advance_frame();
      path->advance_frame();
    }
    EXPECT_EQ(constant->frame().position, path->frame().position);
    EXPECT_EQ(constant->frame().velocity, path->frame().velocity);
  }
}

TEST(GravityPath, PotentialEnergyIsThatOfTheTime) {
  Scene scene = free_block();
  scene.gravity_keyframes = {{scene.frame_time, {0, -2, 0}}};
  ExactRun run(scene);
  EXPECT_EQ(run.solver.diagnostics().potential_energy, 0);
  run.frames(1);
  const Diagnostics end = run.solver.diagnostics();
  EXPECT_NEAR(end.potential_energy, end.mass * 2 * run.mean_position()[1], 1e-9 * end.mass);
}

/// A block in the ball leaves it, and another one takes its place: only the first has the force, also when sorting has
/// mixed their particles in memory.
TEST(Loads, CarriersKeepTheLoadWhereverTheyGo) {
  Scene scene = free_block();
  scene.sources[0].velocity = {4, 0, 0};
  add_box(scene, "jelly", {0.3, 0.5, 0.5});
  scene.sources[1].velocity = {4, 0, 0};
  scene.loads = {load_at(center, 0.08, {0, 0.4, 0}, 0, 1)};
  ExactRun run(scene);
  const double mass = run.solver.diagnostics().mass;
  const auto first =
      static_cast<int32_t>(std::count(run.prepared.particles.source.begin(), run.prepared.particles.source.end(), 0));
  run.frames(12);  // 0.19 m
  const double share = static_cast<double>(first) / static_cast<double>(run.prepared.particles.position.size());
  EXPECT_NEAR(run.mean_position(first)[0], 0.5, 0.02);
  EXPECT_NEAR(run.mean_velocity(0, first)[1], 0.4 * run.solver.time() / (mass * share), 1e-12);
  EXPECT_NEAR(run.mean_velocity(first)[1], 0, 1e-15);
}

/// What is born in the ball later carries nothing; the share of a carrier that a sink takes leaves with it.
TEST(Loads, ParticlesThatComeAndGo) {
  Scene scene = free_block();
  scene.sources[0].velocity = {0.3, 0, 0};
  Emitter emitter;
  emitter.size = {0.04, 0.02, 0.04};
  emitter.position = {0.5, 0.6, 0.5};
  emitter.material = "jelly";
  emitter.velocity = {0, 1, 0};
  scene.emitters.push_back(emitter);
  Sink sink;
  sink.position = {0.58, 0.5, 0.5};
  sink.size = {0.04, 0.2, 0.2};
  scene.sinks.push_back(sink);
  scene.loads = {load_at({0.5, 0.55, 0.5}, 0.2, {0.5, 0, 0}, 0.5 * scene.frame_time, 1)};
  const auto run = Simulation::create(scene, {.precision = Precision::f64});
  run->advance_frame();
  // Of all active particles that were there half a frame before: each gets its part in every step.
  const RunStatistics before = run->statistics();
  const auto active_sources = [&] {
    const std::vector<uint8_t> active = run->frame().active;
    return std::count(active.begin(), active.begin() + 100, 1);
  };
  EXPECT_EQ(active_sources(), 100);
  run->advance_frame();
  const double given = run->statistics().load_momentum[0] - before.load_momentum[0];
  EXPECT_NEAR(given, 0.5 * scene.frame_time, 1e-9) << "nothing has left";
  for (int f = 0; f < 30; ++f) run->advance_frame();
  const RunStatistics late = run->statistics();
  EXPECT_GT(late.born, 50);
  EXPECT_GT(late.removed, 50);
  run->advance_frame();
  const double then = run->statistics().load_momentum[0] - late.load_momentum[0];
  EXPECT_LT(then, 0.98 * 0.5 * scene.frame_time);
  EXPECT_GT(then, 0);
}

TEST(Loads, StationaryAndLedParticlesCarryNothing) {
  Scene scene = free_block();
  add_box(scene, "stationary", {0.5, 0.4, 0.5});
  add_box(scene, "jelly", {0.6, 0.5, 0.5});
  scene.sources[2].motion = Motion{};
  scene.sources[2].release_time = 1.5 * scene.frame_time;
  scene.loads = {load_at(center, 0.05, {0, 0.01, 0}, 0, 1)};
  EXPECT_EQ(Simulation::create(scene, {})->statistics().loads_without_carriers, 0);
  scene.loads[0].place = {0.5, 0.36, 0.5};
  EXPECT_THROW(Simulation::create(scene, {}), ConfigError) << "stationary";
  scene.loads[0].place = {0.64, 0.54, 0.54};
  scene.loads[0].radius = 0.03;
  EXPECT_THROW(Simulation::create(scene, {}), ConfigError) << "led";
  scene.loads[0].start = 2 * scene.frame_time;  // they are free then
  ExactRun run(scene);
  run.frames(3);
  EXPECT_EQ(run.solver.statistics().loads_without_carriers, 0);
  EXPECT_NEAR(run.solver.statistics().load_momentum[1], 0.01 * scene.frame_time, 1e-12);
}

TEST(Loads, OneThatMeetsNothingIsTold) {
  Scene scene = free_block();
  ExactRun without(scene);
  scene.loads = {load_at({0.2, 0.2, 0.2}, 0.05, {1, 0, 0}, scene.frame_time, 1)};
  ExactRun run(scene);
  run.frames(1);
  EXPECT_EQ(run.solver.statistics().loads_without_carriers, 0) << "it has not begun";
  run.frames(1);
  without.frames(2);
  EXPECT_EQ(run.solver.statistics().loads_without_carriers, 1);
  EXPECT_EQ(run.solver.frame().position, without.solver.frame().position);
  scene.loads[0].start = 0;
  EXPECT_THROW(Simulation::create(scene, {}), ConfigError);
}

/// A frame whose equal steps are chosen at its start has room for what a load adds in it.
TEST(Loads, EqualStepsOfAFrameAllowForThem) {
  Scene scene = free_block();
  scene.time_step.policy = StepPolicy::per_frame;
  scene.frame_time = 0.01;
  scene.time_step.substeps_per_frame = 30;
  const auto substeps_of = [](const Scene& any) {
    const auto run = Simulation::create(any, {});
    run->advance_frame();
    return run->statistics().substeps;
  };
  const int64_t least = substeps_of(scene);
  const double mass = Simulation::create(scene, {})->diagnostics().mass;
  scene.loads = {load_at(center, 1, {0, 1e4 * mass, 0}, 0.004, 0.003)};  // to 30 m/s
  EXPECT_GT(substeps_of(scene), least);
}

TEST(Loads, ScenesOfABatchMoveAsAlone) {
  std::vector<PreparedScene> scenes;
  std::vector<std::unique_ptr<Simulation>> alone;
  for (const double force : {0.0, 0.2, 0.5}) {
    Scene scene = free_block();
    if (force > 0) scene.loads = {load_at(center, 0.03, {force, 0, 0}, 0.001, 0.01)};
    scenes.emplace_back(scene, SimulationOptions{});
    alone.push_back(Simulation::create(scenes.back()));
  }
  const auto batch = SceneBatch::create(scenes);
  for (int f = 0; f < 2; ++f) batch->advance_frame();
  const std::vector<ParticleFrame> frames = batch->frames({});
  for (std::size_t i = 0; i < alone.size(); ++i) {
    for (int f = 0; f < 2; ++f) alone[i]->advance_frame();
    EXPECT_EQ(frames[i].position, alone[i]->frame().position);
  }
  EXPECT_NE(frames[1].position, frames[2].position);
}

}  // namespace
}  // namespace graupel::mpm
