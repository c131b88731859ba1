// Forces on the body of a reduced model while it runs.
#include "rom/solver/body_load.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/system/error.h"
#include "rom/reduced_solver.h"
#include "tests/rom/deformation_model.h"

namespace graupel::rom {
namespace {

using namespace test;

constexpr double side = 0.2, frame_time = 0.01, everywhere = 1;  // [m], [s], [m]
const Vec3d center = {0.5, 0.5, 0.5};

/// A block of jelly without gravity, whose model knows its translations.
struct Block {
  Scene scene = jelly_block("[0, 0, 0]");
  ReducedModel model = deformation_model(scene, linear_network(translation()), {0, 0, 0});
  double mass = 0;  // of the particles [kg]

  Block() {
    for (const double volume : mpm::sample_sources(scene, scene.seed).volume)
      mass += scene.materials.at("jelly").density * volume;
  }

  template <typename T>
  ReducedSolver<T> solver(ProjectionKind kind) {
    model.gradient = kind == ProjectionKind::position ? GradientKind::integrated : GradientKind::map;
    ReducedOptions options;
    options.projection = kind;
    return {model, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, options};
  }
  ReducedSolver<double> exact() { return solver<double>(ProjectionKind::velocity); }
};

constexpr ProjectionKind projections[] = {ProjectionKind::position, ProjectionKind::position_velocity,
                                          ProjectionKind::velocity};

template <typename T>
class BodyLoadRun : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(BodyLoadRun, Precisions);

/// Newton's second law, also of a load that begins with a frame and ends within a step.
TYPED_TEST(BodyLoadRun, TheBodyHasTheImpulseAsItsMomentum) {
  Block block;
  const Vec3d force = {0.5 * block.mass, 2 * block.mass, 0};  // accelerations of 0.5 and 2 m/s^2
  const double duration = 1.3 * frame_time;
  for (const ProjectionKind kind : projections) {
    // `position` has velocities as differences of decoded positions.
    const double tolerance = sizeof(TypeParam) == 4 && kind == ProjectionKind::position ? 3e-4 : 1e-6;
    for (const double radius : {everywhere, 0.3 * side}) {
      auto solver = block.solver<TypeParam>(kind);
      solver.advance_frame();
      solver.apply({center, radius, force, duration});
      for (int f = 0; f < 3; ++f) solver.advance_frame();
      for (std::size_t d = 0; d < 3; ++d)
        EXPECT_NEAR(solver.state().velocity[d], force[static_cast<int>(d)] / block.mass * duration, tolerance)
            << word_of(kind) << " " << radius;
    }
  }
}

TEST(BodyLoad, OppositeLoadsLeaveTheBodyAtRest) {
  Block block;
  auto solver = block.exact();
  solver.apply({center, everywhere, {3, 0, 0}, 2 * frame_time});
  solver.apply({center, 0.5 * side, {-3, 0, 0}, 2 * frame_time});
  for (int f = 0; f < 2; ++f) solver.advance_frame();
  EXPECT_NEAR(solver.state().velocity[0], 0, 1e-9);
}

/// Translations alone take of a part's energy what the part has of the body's mass.
TEST(BodyLoad, ShareIsTheEnergyThatTheMapCanTake) {
  Block block;
  auto solver = block.exact();
  const LoadResponse whole = solver.apply({center, everywhere, {1, 2, 3}, frame_time});
  EXPECT_EQ(whole.particles, block.model.fields->particles());
  EXPECT_NEAR(whole.share, 1, 1e-6);
  const LoadResponse part = solver.apply({center, 0.3 * side, {1, 2, 3}, frame_time});
  EXPECT_NEAR(part.share, static_cast<double>(part.particles) / static_cast<double>(whole.particles), 1e-6);
  EXPECT_LT(part.share, 0.2);
}

TEST(BodyLoad, TellsLoadsThatAreFasterThanTheTraining) {
  Block block;
  const auto respond = [&](double speed) {
    return block.exact().apply({center, everywhere, {speed * block.mass / frame_time, 0, 0}, frame_time});
  };
  EXPECT_TRUE(respond(100).is_like_training()) << "the file does not tell how fast its training was";
  block.model.training_latents = {0, 0, 0, 0.02f, 0, 0, 5, 0, 0};  // 2 m/s, then another run
  block.model.training_run = {0, 0, 1};
  EXPECT_NEAR(respond(1.5).speed, 0.75, 1e-4);
  EXPECT_TRUE(respond(1.5).is_like_training());
  EXPECT_FALSE(respond(3).is_like_training());
}

TEST(BodyLoad, LoadsThatCannotBeAreRefused) {
  Block block;
  auto solver = block.exact();
  constexpr double infinite = std::numeric_limits<double>::infinity();
  EXPECT_THROW(solver.apply({center, 0, {1, 0, 0}, 1}), ConfigError);
  EXPECT_THROW(solver.apply({center, -1, {1, 0, 0}, 1}), ConfigError);
  EXPECT_THROW(solver.apply({center, 0.1, {infinite, 0, 0}, 1}), ConfigError);
  EXPECT_THROW(solver.apply({center, 0.1, {1, 0, 0}, 0}), ConfigError);
  EXPECT_THROW(solver.apply({{0.9, 0.5, 0.5}, 0.1, {1, 0, 0}, 1}), ConfigError) << "no matter there";
  solver.advance_frame();
  EXPECT_NEAR(solver.state().velocity[0], 0, 1e-9) << "none of them acts";
}

/// A load of the scene, from within a step on, is that of a call at its time.
TYPED_TEST(BodyLoadRun, TheScenesLoadsActAtTheirTimes) {
  Block block;
  const Vec3d force = {0.5 * block.mass, 2 * block.mass, 0};
  TimedLoad load;
  load.place = center;
  load.force = force;
  load.duration = 1.3 * frame_time;
  for (const ProjectionKind kind : projections) {
    const double tolerance = sizeof(TypeParam) == 4 && kind == ProjectionKind::position ? 3e-4 : 1e-6;
    for (const double radius : {everywhere, 0.3 * side}) {
      load.radius = radius;
      load.start = frame_time;
      block.scene.loads = {load};
      auto by_scene = block.template solver<TypeParam>(kind);
      block.scene.loads.clear();
      auto by_call = block.template solver<TypeParam>(kind);
      for (int f = 0; f < 3; ++f) {
        if (f == 1) by_call.apply(load);
        by_scene.advance_frame();
        by_call.advance_frame();
      }
      for (std::size_t d = 0; d < 3; ++d)
        EXPECT_NEAR(by_scene.state().velocity[d], by_call.state().velocity[d], 1e-9) << word_of(kind) << radius;
      load.start = 0.77 * frame_time;
      block.scene.loads = {load};
      auto within = block.template solver<TypeParam>(kind);
      for (int f = 0; f < 3; ++f) within.advance_frame();
      for (std::size_t d = 0; d < 3; ++d)
        EXPECT_NEAR(within.state().velocity[d], force[static_cast<int>(d)] / block.mass * load.duration, tolerance);
    }
  }
}

TEST(BodyLoad, ALoadOfTheSceneThatMeetsNothingIsTold) {
  Block block;
  TimedLoad load;
  load.place = {0.2, 0.5, 0.5};
  load.radius = 0.05;
  load.force = {1, 0, 0};
  load.start = frame_time;
  load.duration = 1;
  block.scene.loads = {load};
  auto solver = block.exact();
  solver.advance_frame();
  EXPECT_EQ(solver.statistics().loads_without_carriers, 0);
  solver.advance_frame();
  EXPECT_EQ(solver.statistics().loads_without_carriers, 1);
  EXPECT_NEAR(solver.state().velocity[0], 0, 1e-9);
}

/// A model of the block's translations falls as the path says.
TYPED_TEST(BodyLoadRun, GravityFollowsItsPath) {
  Block block;
  block.scene.gravity = {0, -1, 0};
  block.scene.gravity_keyframes = {{3 * frame_time, {2, 1, 0}}};
  for (const ProjectionKind kind : projections) {
    const double tolerance = sizeof(TypeParam) == 4 && kind == ProjectionKind::position ? 3e-4 : 1e-6;
    auto solver = block.template solver<TypeParam>(kind);
    for (int f = 0; f < 3; ++f) solver.advance_frame();
    EXPECT_NEAR(solver.state().velocity[0], 1.5 * 2 * frame_time, tolerance) << word_of(kind);
    EXPECT_NEAR(solver.state().velocity[1], 0, tolerance) << word_of(kind);
  }
}

}  // namespace
}  // namespace graupel::rom
