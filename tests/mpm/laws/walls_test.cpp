// Each wall by itself: contact, open and periodic walls.
#include <gtest/gtest.h>

#include "mpm/simulation.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

/// Jelly that lands on the floor while it flies along x.
std::vector<Vec3f> landed(const Scene& walls) {
  Scene scene = scene_with("jelly", {0.3, 0.1, 0.5});
  scene.domain = walls.domain;
  scene.sources[0].velocity = {2, -1, 0};
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 4; ++f) sim->advance_frame();
  return sim->frame().position;
}

TEST(Walls, AFaceOfItsOwnDoesWhatAllWallsOfThatKindDo) {
  for (const Contact kind : {Contact::stick, Contact::slip, Contact::separate}) {
    Scene all, one;
    all.domain.walls = kind;
    all.domain.wall_friction = 0.4;
    one.domain.walls = Contact::slip;  // touched by nothing
    one.domain.wall_friction = 0.1;
    one.domain.faces.y_low = WallConfig{.kind = wall_of(kind), .friction = 0.4};
    EXPECT_EQ(landed(all), landed(one)) << word_of(kind);
    one.domain.faces.y_low->friction.reset();
    one.domain.wall_friction = 0.4;
    EXPECT_EQ(landed(all), landed(one)) << word_of(kind);
  }
}

TEST(Walls, ParticlesLeaveThroughAnOpenWallAndNothingHoldsThem) {
  Scene scene = scene_with("jelly", {0.88, 0.5, 0.5});
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {1, 0, 0};
  scene.domain.faces.x_high = WallConfig{.kind = Wall::open, .friction = {}};
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  const auto n = static_cast<int64_t>(sim->particle_count());
  const double mass = sim->diagnostics().mass;
  for (int f = 0; f < 9; ++f) {
    sim->advance_frame();
    const ParticleFrame frame = sim->frame();
    const Diagnostics d = sim->diagnostics();
    int64_t active = 0;
    for (std::size_t i = 0; i < frame.active.size(); ++i) {
      active += frame.active[i];
      if (frame.active[i]) {
        ASSERT_LE(frame.position[i][0], static_cast<float>(scene.wall_high()[0]));
      } else {
        ASSERT_EQ(frame.velocity[i], Vec3f::zero());
      }
    }
    EXPECT_EQ(active, n - sim->statistics().removed);
    EXPECT_NEAR(d.mass, mass * static_cast<double>(active) / static_cast<double>(n), 1e-9 * mass);
    EXPECT_NEAR(d.momentum[0], d.mass, 1e-9 * mass);  // speed 1 to the end: no force at the wall
  }
  EXPECT_EQ(sim->statistics().removed, n);
  EXPECT_EQ(sim->diagnostics().mass, 0);
}

Scene periodic_scene(bool x, bool y, bool z) {
  Scene scene = scene_with("jelly");
  scene.gravity = {0, 0, 0};
  const WallConfig wall{.kind = Wall::periodic, .friction = {}};
  if (x) scene.domain.faces.x_low = scene.domain.faces.x_high = wall;
  if (y) scene.domain.faces.y_low = scene.domain.faces.y_high = wall;
  if (z) scene.domain.faces.z_low = scene.domain.faces.z_high = wall;
  return scene;
}

/// Two bodies that collide about `center`, each sampled as its own list of points, shifted through the walls.
Scene collision_about(Scene scene, const Vec3d& center) {
  const Vec3d low = scene.wall_low(), width = scene.wall_high() - low;
  scene.sources.clear();
  const Random random(3, RandomPurpose::test);
  for (const double side : {-1.0, 1.0}) {
    std::vector<Vec3d> points;
    for (uint64_t i = 0; i < 800; ++i) {
      Vec3d x;
      for (int d = 0; d < 3; ++d) {
        x[d] = center[d] + 0.04 * side + random.uniform(i + (side > 0 ? 1000 : 0), d, -0.035, 0.035);
        while (x[d] < low[d]) x[d] += width[d];
        while (x[d] >= low[d] + width[d]) x[d] -= width[d];
      }
      points.push_back(x);
    }
    Source source;
    source.shape = Shape::points;
    source.points = std::make_shared<const std::vector<Vec3d>>(points);
    source.material = "jelly";
    source.velocity = {-2 * side, -side, -side};
    scene.sources.push_back(source);
  }
  return scene;
}

/// A run about the corner of the walls is the run about the middle, half a period (29 cells) further.
void check_shifted_collision(bool x, bool y, bool z) {
  const Scene base = periodic_scene(x, y, z);
  const Vec3d low = base.wall_low(), middle = Vec3d::filled(0.5), half = middle - low;
  Vec3d corner = middle;
  if (x) corner[0] = low[0];
  if (y) corner[1] = low[1];
  if (z) corner[2] = low[2];
  const auto inner = Simulation::create(collision_about(base, middle), {.precision = Precision::f64}),
             outer = Simulation::create(collision_about(base, corner), {.precision = Precision::f64});
  const Diagnostics start = outer->diagnostics();
  for (int f = 0; f < 3; ++f) {
    inner->advance_frame();
    outer->advance_frame();
  }
  const Diagnostics a = inner->diagnostics(), b = outer->diagnostics();
  EXPECT_LT(a.kinetic_energy, 0.9 * start.kinetic_energy);  // they did meet
  EXPECT_NEAR(a.kinetic_energy, b.kinetic_energy, 1e-7 * start.kinetic_energy);
  EXPECT_LT(norm(b.momentum - start.momentum), 1e-11);
  const ParticleFrame p = inner->frame(), q = outer->frame();
  for (std::size_t i = 0; i < p.position.size(); ++i)
    for (int d = 0; d < 3; ++d) {
      ASSERT_GE(q.position[i][d], static_cast<float>(low[d]));
      double apart = static_cast<double>(q.position[i][d]) - static_cast<double>(p.position[i][d]);
      if (corner[d] != middle[d]) apart = std::abs(apart) - half[d];
      ASSERT_NEAR(apart, 0, 1e-5);
    }
}

TEST(Walls, APeriodicWallIsNoWall) {
  check_shifted_collision(true, false, false);
  check_shifted_collision(false, true, true);
  check_shifted_collision(true, true, true);
}

TEST(Walls, ABodyThatFliesThroughAPeriodicWallFeelsNothing) {
  Scene scene = periodic_scene(true, false, false);
  scene.sources[0].velocity = {6, 0, 0};
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  for (int f = 0; f < 12; ++f) sim->advance_frame();  // once around
  const Diagnostics d = sim->diagnostics();
  EXPECT_NEAR(d.momentum[0], 6 * d.mass, 1e-10 * d.mass);
  EXPECT_LT(d.elastic_energy, 1e-12 * d.mass);
  EXPECT_EQ(sim->statistics().removed, 0);
}

/// Particles that the wall stops lie on nodes: a cubic spline's outermost weights are about (1e-6)^3 / 6 along an axis,
/// and their product with a mass has no reciprocal in single precision.
TEST(Walls, NodesThatASupportJustReachesStayEmpty) {
  for (const char* material : {"water", "jelly", "dry_sand"}) {
    Scene scene = scene_with(material);
    scene.domain.dx = 0.04;
    scene.transfer.spline = Spline::cubic;
    scene.sources[0].size = {0.76, 0.3, 0.76};
    scene.sources[0].position = {0.5, 0.27, 0.5};
    scene.sources[0].sampling = Sampling::jittered_lattice;
    scene.time_step = {.policy = StepPolicy::adaptive};
    const auto sim = Simulation::create(scene, {.seed = scene.seed});
    EXPECT_NO_THROW(sim->advance_frame()) << material;
  }
}

}  // namespace
}  // namespace graupel::mpm
