// Points carried by a run: they follow the particles that they start on, are born and leave as these are and do, stay
// out of obstacles, and change nothing.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/system/error.h"
#include "mpm/scene_variants.h"
#include "sparsegrid/obstacle_set.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

std::vector<Vec3f> cast(const std::vector<Vec3d>& from) {
  std::vector<Vec3f> to;
  for (const Vec3d& x : from) to.push_back(x.cast<float>());
  return to;
}

/// A run with tracers at the start of the particles of `truth`.
std::unique_ptr<Simulation> carrying(const Scene& scene, const Scene& truth, const SimulationOptions& options) {
  auto simulation = Simulation::create(scene, options);
  const SampledParticles particles = sample_sources(truth, options.seed);
  simulation->carry_tracers(cast(particles.position), cast(particles.velocity), particles.birth_time);
  return simulation;
}

double largest_distance(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  double most = a.size() == b.size() ? 0 : 1e9;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) most = std::max(most, double(norm(a[i] - b[i])));
  return most;
}

const SimulationOptions in_double{.precision = Precision::f64};

TEST(Tracers, FollowTheirParticlesInTranslationAndFreeFall) {
  for (const bool falls : {false, true}) {
    Scene scene = scene_with("jelly");
    scene.sources[0].velocity = {0.7, 0.4, -0.5};
    if (!falls) scene.gravity = Vec3d::zero();
    const auto run = carrying(scene, scene, in_double);
    for (int f = 0; f < 4; ++f) run->advance_frame();
    EXPECT_LT(largest_distance(run->tracers(), run->frame().position), 2e-7);
    EXPECT_GT(norm(run->tracers()[0] - cast(sample_sources(scene, 0).position)[0]), 0.04f);
  }
}

TEST(Tracers, OfACoarseRunFallFreelyToRoundOff) {
  Scene scene = scene_with("water");
  scene.sources[0].velocity = {0.7, 0.4, -0.5};
  const auto truth = Simulation::create(scene, in_double);
  const auto coarse = carrying(coarse_variant(scene), scene, in_double);
  for (int f = 0; f < 4; ++f) {
    truth->advance_frame();
    coarse->advance_frame();
  }
  // Symplectic Euler with steps of h falls g h t / 2 further than without: half the steps, twice that.
  const double t = 4 * scene.frame_time, h = scene.frame_time / 54;
  for (std::size_t i = 0; i < coarse->tracers().size(); ++i) {
    const Vec3f error = coarse->tracers()[i] - truth->frame().position[i];
    ASSERT_NEAR(error[1], -9.8 * h * t / 2, 2e-6);
    ASSERT_NEAR(error[0], 0, 2e-7);
    if (i > 200) break;
  }
}

TEST(Tracers, FollowTheirParticlesOntoTheFloor) {
  for (const char* material : {"taichi_water", "taichi_sand", "taichi_snow"})
    for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
      Scene scene = scene_with(material, {0.5, 0.15, 0.5});
      scene.domain.dx = 1.0 / 32;
      scene.sources[0].velocity = {0.5, -2, 0};
      const auto run = carrying(scene, scene, {.kernels = kernels});
      for (int f = 0; f < 8; ++f) run->advance_frame();
      EXPECT_LT(largest_distance(run->tracers(), run->frame().position), 0.02 * scene.domain.dx) << material;
    }
}

TEST(Tracers, LeaveTheRunsBytesAsTheyAre) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    const Scene scene = four_materials();
    const auto with = carrying(scene, scene, {.kernels = kernels}),
               without = Simulation::create(scene, {.kernels = kernels});
    for (int f = 0; f < 3; ++f) {
      with->advance_frame();
      without->advance_frame();
    }
    EXPECT_EQ(with->save_state(), without->save_state());
    EXPECT_GT(with->tracer_seconds(), 0);
    EXPECT_EQ(without->tracer_seconds(), 0);
  }
}

TEST(Tracers, OfACoarseRunStayOutsideObstaclesAndInsideTheWalls) {
  Scene scene = scene_with("taichi_water", {0.5, 0.42, 0.5}, 0.16);
  scene.domain.dx = 1.0 / 32;
  scene.sources[0].velocity = {0, -3, 0};
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.12;
  ball.position = {0.5, 0.2, 0.5};
  scene.obstacles.push_back(ball);
  const sparsegrid::ObstacleSet obstacles(scene);
  const auto coarse = carrying(coarse_variant(scene), scene, {});
  double deepest = 0;
  for (int f = 0; f < 15; ++f) {
    coarse->advance_frame();
    for (const Vec3f& x : coarse->tracers()) {
      deepest = std::min(deepest, double(obstacles.sample(x.cast<double>()).phi));
      for (int d = 0; d < 3; ++d) {
        ASSERT_GE(x[d], scene.wall_low()[d] - 1e-6);
        ASSERT_LE(x[d], scene.wall_high()[d] + 1e-6);
      }
    }
  }
  EXPECT_GT(deepest, -1e-3 * scene.domain.dx);
}

/// A stream of water that falls into a sink on the floor.
Scene stream_into_a_sink() {
  Scene scene = scene_with("taichi_water", {0.25, 0.3, 0.5});
  scene.domain.dx = 1.0 / 32;
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.1, 0.03, 0.1};
  emitter.position = {0.6, 0.5, 0.5};
  emitter.material = "taichi_water";
  emitter.velocity = {0, -1.5, 0};
  emitter.start_time = 0.02;
  emitter.end_time = 0.1;
  scene.emitters.push_back(emitter);
  Sink sink;
  sink.shape = RegionShape::half_space;
  sink.position = {0.5, 0.35, 0.5};
  scene.sinks.push_back(sink);
  return scene;
}

int64_t sum(const std::vector<uint8_t>& active) { return std::count(active.begin(), active.end(), 1); }

TEST(Tracers, AreBornAndLeaveWithTheirParticles) {
  const Scene scene = stream_into_a_sink();
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    const auto run = carrying(scene, scene, {.kernels = kernels});
    EXPECT_EQ(run->active_tracers(), run->frame().active);
    int64_t most = 0;
    for (int f = 0; f < 14; ++f) {
      run->advance_frame();
      const ParticleFrame frame = run->frame();
      const auto active = run->active_tracers();
      ASSERT_EQ(active.size(), frame.position.size());
      int64_t unlike = 0;
      for (std::size_t i = 0; i < active.size(); ++i) {
        unlike += active[i] != frame.active[i];
        if (active[i] != 0 && frame.active[i] != 0) {
          ASSERT_LT(norm(run->tracers()[i] - frame.position[i]), 0.1 * scene.domain.dx) << f;
        }
      }
      EXPECT_LE(unlike, static_cast<int64_t>(active.size() / 100)) << f;  // at the sink's face
      most = std::max(most, sum(active));
    }
    EXPECT_GT(most, static_cast<int64_t>(run->frame().position.size() / 3));
    EXPECT_EQ(sum(run->active_tracers()), sum(run->frame().active));
    EXPECT_LT(sum(run->active_tracers()), most / 2);
  }
}

TEST(Tracers, OfACoarseRunFollowAStreamAndItsEnd) {
  const Scene scene = stream_into_a_sink();
  const auto truth = Simulation::create(scene, {});
  const auto coarse = carrying(coarse_variant(scene), scene, {});
  for (int f = 0; f < 14; ++f) {
    truth->advance_frame();
    coarse->advance_frame();
    const auto expected = static_cast<double>(sum(truth->frame().active)),
               n = static_cast<double>(coarse->tracers().size());
    EXPECT_NEAR(static_cast<double>(sum(coarse->active_tracers())), expected, 0.05 * n) << f;
  }
}

TEST(Tracers, LeaveThroughOpenWallsAndStayWhereTheyLeft) {
  Scene scene = scene_with("taichi_jelly", {0.15, 0.5, 0.5});
  scene.domain.faces.x_low = WallConfig{.kind = Wall::open, .friction = {}};
  scene.gravity = Vec3d::zero();
  scene.sources[0].velocity = {-2, 0, 0};
  const auto run = carrying(scene, scene, {});
  for (int f = 0; f < 8; ++f) run->advance_frame();
  EXPECT_EQ(sum(run->active_tracers()), 0);
  for (const Vec3f& x : run->tracers()) {
    ASSERT_LT(x[0], scene.wall_low()[0]);
    ASSERT_GT(x[0], scene.wall_low()[0] - scene.domain.dx);
  }
}

TEST(Tracers, PassPeriodicWalls) {
  for (const bool plane : {false, true}) {
    Scene scene = scene_with("taichi_jelly", {0.12, 0.5, 0.5});
    if (plane) scene = in_the_plane(scene);
    scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{.kind = Wall::periodic, .friction = {}};
    scene.gravity = Vec3d::zero();
    scene.sources[0].velocity = {-1.5, 0.2, 0};
    const auto run = carrying(scene, scene, in_double);
    for (int f = 0; f < 4; ++f) run->advance_frame();
    EXPECT_LT(largest_distance(run->tracers(), run->frame().position), 1e-5) << plane;
    for (int f = 0; f < 2; ++f) run->advance_frame();
    EXPECT_GT(run->tracers()[0][0], 0.8f);
    EXPECT_LT(largest_distance(run->tracers(), run->frame().position), 1e-5) << plane;
    EXPECT_TRUE(run->active_tracers().empty());
  }
}

TEST(Tracers, OfAPlaneRunStayInItAndOnTheFloor) {
  Scene scene = in_the_plane(scene_with("taichi_water", {0.5, 0.2, 0.5}, 0.12));
  scene.domain.dx = 1.0 / 32;
  const auto coarse = carrying(coarse_variant(scene), scene, {}), own = carrying(scene, scene, {});
  for (int f = 0; f < 12; ++f) {
    coarse->advance_frame();
    own->advance_frame();
  }
  EXPECT_LT(largest_distance(own->tracers(), own->frame().position), 0.1 * scene.domain.dx);
  for (const Vec3f& x : coarse->tracers()) {
    ASSERT_NEAR(x[2], scene.domain.plane(), 1e-7);
    ASSERT_GE(x[1], scene.wall_low()[1] - 1e-6);
  }
  EXPECT_LT(largest_distance(coarse->tracers(), own->frame().position), 3 * scene.domain.dx);
}

TEST(Tracers, ArePushedByMovingObstacles) {
  Scene scene = scene_with("taichi_sand", {0.5, 0.15, 0.5}, 0.1);
  scene.domain.dx = 1.0 / 32;
  Obstacle box;
  box.shape = Shape::box;
  box.size = {0.1, 0.3, 0.4};
  box.position = {0.35, 0.25, 0.5};
  box.motion.emplace();
  box.motion->velocity = {1, 0, 0};
  scene.obstacles.push_back(box);
  const auto coarse = carrying(coarse_variant(scene), scene, {});
  for (int f = 0; f < 12; ++f) coarse->advance_frame();
  for (const Vec3f& x : coarse->tracers()) ASSERT_GT(x[0], 0.35 + 0.05 + 12.0 / 60 - 0.05 * scene.domain.dx);
}

TEST(Tracers, OfOtherListsAreRefused) {
  const auto plain = Simulation::create(scene_with("water"), {});
  EXPECT_THROW(plain->carry_tracers({{0.5f, 0.5f, 0.5f}}, {}), ConfigError);
  EXPECT_THROW(plain->carry_tracers({{0.5f, 0.5f, 0.5f}}, {{0, 0, 0}}, {0, 1}), ConfigError);
  EXPECT_TRUE(plain->tracers().empty());
}

}  // namespace
}  // namespace graupel::mpm
