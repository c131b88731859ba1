// Particles that follow a script: exactly, with a balance of momentum, until they are released.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

KinematicRegion region_below(const Vec3d& at, const Vec3d& normal, const Motion& motion) {
  KinematicRegion region;
  region.shape = RegionShape::half_space;
  region.position = at;
  region.normal = normal;
  region.motion = motion;
  return region;
}

/// A jelly bar along x whose ends are kinematic; the left one may be stationary, the right one is pulled and twisted.
Scene torsion() {
  Scene scene = scene_with("jelly");
  scene.gravity = {0, 0, 0};
  scene.frames = 30;
  scene.sources[0].size = {0.24, 0.08, 0.08};
  Motion pull;
  pull.velocity = {0.3, 0, 0};
  pull.spin = 4;
  pull.axis = {1, 0, 0};
  pull.center = Vec3d{0.6, 0.5, 0.5};
  scene.kinematic_regions = {region_below({0.41, 0.5, 0.5}, {1, 0, 0}, Motion{}),
                             region_below({0.59, 0.5, 0.5}, {-1, 0, 0}, pull)};
  return scene;
}

void check_torsion(Precision precision, double position_tolerance, double momentum_tolerance) {
  const Scene scene = torsion();
  const auto sim = Simulation::create(scene, {.precision = precision});
  const ParticleFrame start = sim->frame();
  sim->advance_frame();
  const Diagnostics first = sim->diagnostics();
  const RunStatistics before = sim->statistics();
  for (int f = 0; f < 9; ++f) sim->advance_frame();
  const RigidMap pose = scene.kinematic_regions[1].motion.at(sim->time(), {});
  const ParticleFrame end = sim->frame();
  int scripted = 0, stationary = 0;
  for (std::size_t i = 0; i < start.position.size(); ++i) {
    const Vec3d x = start.position[i].cast<double>();
    if (x[0] < 0.41 - 1e-6) {
      ++stationary;
      ASSERT_EQ(end.position[i], start.position[i]);
    } else if (x[0] > 0.59 + 1e-6) {
      ++scripted;
      ASSERT_LT(norm(end.position[i].cast<double>() - pose(x)), position_tolerance);
    }
  }
  EXPECT_GT(scripted, 200);
  EXPECT_GT(stationary, 200);
  const Diagnostics last = sim->diagnostics();
  const Vec3d given = sim->statistics().scripted_momentum - before.scripted_momentum;
  EXPECT_LT(norm(last.momentum - first.momentum - given), momentum_tolerance * last.mass);
  EXPECT_GT(last.elastic_energy, 1e-4);
}

TEST(KinematicParticles, FollowTheirScriptExactlyAndItsImpulseBalancesTheMomentum) {
  check_torsion(Precision::f32, 2e-5, 2e-5);
  check_torsion(Precision::f64, 1e-7, 1e-11);
}

TEST(KinematicParticles, ThatAreHeldStandStillUnderLoad) {
  Scene scene = scene_with("jelly", {0.5, 0.3, 0.5});
  scene.sources[0].motion = Motion{};
  add_box(scene, "snow", {0.5, 0.382, 0.5});
  const auto sim = Simulation::create(scene, {});
  const ParticleFrame start = sim->frame();
  for (int f = 0; f < 20; ++f) sim->advance_frame();
  const ParticleFrame end = sim->frame();
  double height = 0;
  std::size_t stationary = 0;
  for (std::size_t i = 0; i < start.position.size(); ++i) {
    if (sim->particle_type()[i] == particle_type_of(MaterialModel::jelly)) {
      ++stationary;
      ASSERT_EQ(start.position[i], end.position[i]);
    } else {
      height += static_cast<double>(end.position[i][1]);
    }
  }
  // The snow rests on the stationary block.
  EXPECT_NEAR(height / static_cast<double>(start.position.size() - stationary), 0.38, 0.02);
}

TEST(KinematicParticles, MoveOthersByThePartOfTheirMotion) {
  Scene scene = torsion();
  scene.kinematic_regions.erase(scene.kinematic_regions.begin());
  scene.kinematic_regions[0].motion.spin = 0;
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 20; ++f) sim->advance_frame();
  const Diagnostics d = sim->diagnostics();
  EXPECT_NEAR(d.momentum[0], 0.3 * d.mass, 0.06 * d.mass);  // the free bar swings about the speed of its end
}

TEST(KinematicParticles, AreFreeOnceReleased) {
  Scene scene = torsion();
  for (KinematicRegion& region : scene.kinematic_regions) region.release_time = 0.05;
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  for (int f = 0; f < 4; ++f) sim->advance_frame();
  const Diagnostics released = sim->diagnostics();
  const Vec3d given = sim->statistics().scripted_momentum;
  const ParticleFrame before = sim->frame();
  for (int f = 0; f < 4; ++f) sim->advance_frame();
  const Diagnostics end = sim->diagnostics();
  EXPECT_EQ(sim->statistics().scripted_momentum, given);
  EXPECT_LT(norm(end.momentum - released.momentum), 1e-11 * end.mass);
  EXPECT_LT(norm(end.angular_momentum - released.angular_momentum), 1e-11 * end.mass);
  double moved = 0;
  const ParticleFrame after = sim->frame();
  for (std::size_t i = 0; i < before.position.size(); ++i)
    if (before.position[i][0] < 0.41f)
      moved = std::max(moved, static_cast<double>(norm(after.position[i] - before.position[i])));
  EXPECT_GT(moved, 1e-3);
}

std::string refused(const Scene& scene) {
  try {
    Simulation::create(scene, {});
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(KinematicParticles, AreNotLedOutOfTheWallsNorFasterThanACellInAStep) {
  Scene scene = torsion();
  scene.frames = 300;
  EXPECT_THAT(refused(scene), testing::AllOf(testing::HasSubstr("kinematic region 1 leads particles out of the walls"),
                                             testing::HasSubstr("allowed")));
  scene.kinematic_regions[1].release_time = 0.5;
  EXPECT_EQ(refused(scene), "");
  scene.kinematic_regions[1].motion.spin = 4000;
  EXPECT_THAT(refused(scene), testing::HasSubstr("cells in a substep"));
}

/// The bar of torsion(), of which the left end lies in a stick obstacle.
Scene gripped() {
  Scene scene = torsion();
  Obstacle grip;
  grip.shape = Shape::box;
  grip.size = {0.1, 0.2, 0.2};
  grip.position = {0.36, 0.5, 0.5};
  grip.contact = Contact::stick;
  scene.obstacles.push_back(grip);
  return scene;
}

/// How far the particles between x = 0.41 and 0.44 come.
double way_of_the_attached(const Scene& scene) {
  const auto sim = Simulation::create(scene, {});
  const ParticleFrame start = sim->frame();
  for (int f = 0; f < 6; ++f) sim->advance_frame();
  const ParticleFrame end = sim->frame();
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < start.position.size(); ++i)
    if (start.position[i][0] > 0.411f && start.position[i][0] < 0.44f) {
      sum += static_cast<double>(end.position[i][0] - start.position[i][0]);
      ++count;
    }
  EXPECT_GT(count, 50);
  return sum / count;
}

TEST(KinematicParticles, AStickObstacleAroundThemHoldsWhatIsAttached) {
  Scene alone = gripped();
  alone.obstacles.clear();
  EXPECT_LT(way_of_the_attached(gripped()), 0.5 * way_of_the_attached(alone));
}

TEST(KinematicParticles, OnlyThoseWithoutReleaseMayLieInObstacles) {
  EXPECT_NO_THROW(Simulation::create(gripped(), {}));
  Scene scene = gripped();
  scene.kinematic_regions[0].release_time = 0.05;
  try {
    Simulation::create(scene, {});
    FAIL() << "not refused";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("overlaps obstacle 0"));
  }
}

}  // namespace
}  // namespace graupel::mpm
