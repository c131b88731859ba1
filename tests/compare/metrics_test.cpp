// Each metric on cases whose answer is known by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "compare/deciding_metrics.h"
#include "compare/metrics/containment.h"
#include "compare/metrics/density_grid.h"
#include "compare/metrics/displacement_error.h"
#include "compare/metrics/kinetic_energy.h"
#include "compare/metrics/material_shape.h"
#include "compare/metrics/one_step_error.h"
#include "compare/metrics/optimal_transport.h"
#include "compare/metrics/position_error.h"
#include "core/math/random.h"
#include "core/system/error.h"
#include "tests/compare/synthetic_run.h"

namespace graupel::compare {
namespace {

const std::vector<int32_t> two_types = {5, 6};
const std::vector<Vec3f> two_points = {{0.3f, 0.3f, 0.3f}, {0.6f, 0.6f, 0.6f}};

TEST(PositionError, GrowsWithAConstantDrift) {
  const auto truth = make_run(two_points, two_types, 4, stay);
  const auto drifting = make_run(two_points, two_types, 4, [](const Vec3f& x, std::size_t f) {
    return x + Vec3f{0.01f * static_cast<float>(f), 0, 0};
  });
  const auto curve = position_error_curve(truth, drifting);
  ASSERT_EQ(curve.size(), 4u);  // the given start does not count
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(curve[k], 1e-4 * std::pow(k + 1.0, 2), 1e-9);
  EXPECT_NEAR(mean_of_first(curve, 2), 1e-4 * (1 + 4) / 2, 1e-9);
  EXPECT_NEAR(mean_of_first(curve, 100), 1e-4 * (1 + 4 + 9 + 16) / 4, 1e-9);
}

TEST(PositionError, SumsAxesAndAveragesParticlesOfAType) {
  const auto truth = make_run(two_points, two_types, 1, stay);
  const auto other = make_run(two_points, two_types, 1, [](const Vec3f& x, std::size_t f) {
    return f == 1 && x[0] < 0.5f ? x + Vec3f{0.1f, 0.2f, 0.2f} : x;
  });
  EXPECT_NEAR(position_error_curve(truth, other)[0], 0.09 / 2, 1e-7);
  EXPECT_NEAR(position_error_curve(truth, other, 5)[0], 0.09, 1e-7);
  EXPECT_NEAR(position_error_curve(truth, other, 6)[0], 0, 1e-12);
}

TEST(PositionError, RefusesRunsOfOtherParticles) {
  const auto truth = make_run(two_points, two_types, 1, stay);
  const auto other = make_run({two_points[0]}, {5}, 1, stay), swapped = make_run(two_points, {6, 5}, 1, stay);
  EXPECT_TRUE(same_particles(truth, truth));
  for (const auto& run : {other, swapped}) {
    EXPECT_FALSE(same_particles(truth, run));
    EXPECT_THROW(position_error_curve(truth, run), InputError);
  }
}

TEST(HoldLastFrame, RepeatsTheLastUsableFrame) {
  auto run = make_run(two_points, two_types, 2, [](const Vec3f& x, std::size_t f) {
    return x + Vec3f{0, static_cast<float>(f), 0};
  });
  hold_last_frame(run.trajectory, 5);
  ASSERT_EQ(run.predicted(), 5u);
  EXPECT_EQ(run.position(5)[1], run.position(2)[1]);
  EXPECT_NEAR(run.trajectory.frames[5].time, 5.0 / 60, 1e-12);
}

TEST(OneStepError, PerfectPredictionAndBothBaselines) {
  const Vec3d gravity = {0, -9.8, 0};
  const double dt = 1.0 / 60, fall = 9.8 * dt * dt;
  OneStepAccumulator error(gravity, dt, 1.0 / 64);
  // Airborne, near a wall and in the bulk, with accelerations -g, +2 g and 0 (in units of g dt^2, upwards).
  const std::vector<Vec3d> truth = {{0, -fall, 0}, {0, 2 * fall, 0}, {0, 0, 0}};
  const std::vector<double> clearance = {0.01, 0.01, 0.3};
  error.add(truth, truth, clearance);
  const OneStepError e = error.result();
  EXPECT_EQ(e.model, 0);
  EXPECT_NEAR(e.zero, fall * fall * (1 + 4 + 0) / 3, 1e-15);
  EXPECT_NEAR(e.ballistic, fall * fall * (0 + 9 + 1) / 3, 1e-15);
  EXPECT_NEAR(e.variance, fall * fall * (5.0 / 3 - 1.0 / 9), 1e-15);
  for (int s = 0; s < 3; ++s) EXPECT_NEAR(e.share[s], 1.0 / 3, 1e-12);
}

TEST(OneStepError, SplitsByWhatTheParticleDoes) {
  const Vec3d gravity = {0, -9.8, 0};
  const double dt = 1.0 / 60, fall = 9.8 * dt * dt, dx = 1.0 / 64;
  OneStepAccumulator error(gravity, dt, dx);
  EXPECT_EQ(error.state_of({0, -0.96 * fall, 0}, 0), ParticleState::airborne);
  EXPECT_EQ(error.state_of({0, -0.94 * fall, 0}, 1.9 * dx), ParticleState::near_obstacle);
  EXPECT_EQ(error.state_of({0, -0.94 * fall, 0}, 2.1 * dx), ParticleState::bulk);
  const std::vector<Vec3d> truth = {{0, -fall, 0}, {0, 0, 0}};
  const std::vector<Vec3d> predicted = {{1e-3, -fall, 0}, {0, 0, 2e-3}};
  error.add(predicted, truth, {1, 0});
  const OneStepError e = error.result();
  EXPECT_NEAR(e.model, (1e-6 + 4e-6) / 2, 1e-15);
  EXPECT_NEAR(e.model_by_state[0], 1e-6, 1e-15);
  EXPECT_NEAR(e.model_by_state[1], 4e-6, 1e-15);
  EXPECT_EQ(e.model_by_state[2], 0);  // nobody there
  EXPECT_EQ(e.share[2], 0);
}

TEST(OneStepError, NothingAddedIsFinite) {
  const OneStepError e = OneStepAccumulator({0, 0, 0}, 1.0 / 60, 1.0 / 64).result();
  EXPECT_EQ(e.model, 0);
  EXPECT_GT(e.variance, 0);
}

TEST(OneStepError, AccelerationIsTheSecondDifference) {
  const auto a = frame_accelerations({{0, 0, 0}}, {{1, 0, 0}}, {{4, -1, 0}});
  EXPECT_EQ(a[0], (Vec3d{2, -1, 0}));
}

WeightedPoints cloud(int n, uint64_t stream, const Vec3d& shift) {
  WeightedPoints points;
  const Random random(1, RandomPurpose::test, stream);
  for (int i = 0; i < n; ++i) {
    points.position.push_back(shift + 0.3 * Vec3d{random.uniform(i, 0), random.uniform(i, 1), random.uniform(i, 2)});
    points.weight.push_back(1.0 / n);
  }
  return points;
}

TEST(Sinkhorn, ATranslationCostsItsSquare) {
  // OT_eps(a, a + d) = OT_eps(a, a) + |d|^2 for the squared distance, so the divergence is |d|^2 whatever eps.
  const auto a = cloud(120, 0, {0, 0, 0});
  for (const double d : {0.02, 0.2})
    for (const double eps : {5e-3, 2e-2})
      EXPECT_NEAR(sinkhorn_divergence(a, cloud(120, 0, {d, 0, 0}), eps), d * d, 2e-4 * eps + 1e-3 * d * d);
}

TEST(Sinkhorn, TellsAShiftOfTheResolutionFromNone) {
  const double dx = 0.02, shift = resolved_shift * dx, least = resolution(dx).at("sinkhorn");
  const auto a = cloud(120, 0, {0, 0, 0});
  EXPECT_NEAR(sinkhorn_divergence(a, cloud(120, 0, {shift, 0, 0}), 4 * dx * dx), least, least / 2);
  EXPECT_LT(sinkhorn_divergence(a, cloud(120, 0, {shift / 10, 0, 0}), 4 * dx * dx), least / 10);
}

TEST(Sinkhorn, TwoDiracsAndIdenticalClouds) {
  const WeightedPoints a{{{0, 0, 0}}, {1}}, b{{{0.3, 0.4, 0}}, {1}};
  EXPECT_NEAR(sinkhorn_divergence(a, b, 1e-3), 0.25, 1e-9);
  const auto c = cloud(50, 3, {0, 0, 0});
  EXPECT_EQ(sinkhorn_divergence(c, c, 1e-3), 0);
}

TEST(Sinkhorn, DoesNotSeeTheOrderOfParticles) {
  const auto a = cloud(60, 0, {0, 0, 0});
  auto b = a;
  std::reverse(b.position.begin(), b.position.end());
  EXPECT_NEAR(sinkhorn_divergence(a, b, 1e-3), 0, 1e-7);
}

TEST(Sinkhorn, UnequalWeightsMoveTheirShare) {
  // Three quarters of the mass at 0 against one quarter: half of the mass moves by 1.
  const WeightedPoints a{{{0, 0, 0}, {1, 0, 0}}, {0.75, 0.25}}, b{{{0, 0, 0}, {1, 0, 0}}, {0.25, 0.75}};
  EXPECT_NEAR(sinkhorn_divergence(a, b, 1e-3), 0.5, 1e-3);
}

TEST(Sinkhorn, BinsKeepMassAndCentre) {
  const std::vector<Vec3d> position = {{0.01, 0.01, 0.01}, {0.03, 0.01, 0.01}, {0.95, 0.5, 0.5}};
  const auto points = bin_points(position, {1, 3, 4}, 0.1);
  ASSERT_EQ(points.weight.size(), 2u);
  EXPECT_NEAR(points.weight[0], 0.5, 1e-12);
  EXPECT_NEAR(points.position[0][0], 0.025, 1e-12);
  WeightedPoints a, b;
  bin_together(position, {1, 1, 1}, position, {1, 1, 1}, 1e-3, 2, a, b);
  EXPECT_LE(a.weight.size(), 2u);
}

TEST(DensityGrid, SpreadsAllTheMassOfEachMaterial) {
  const Scene scene = unit_scene();
  const auto run = make_run({{0.31f, 0.42f, 0.53f}, {2.0f, 0.5f, -1.0f}}, {5, 6}, 1, stay);
  const auto field = DensityGrid(scene.domain).spread(run, 1, {5, 6});
  for (const auto& mass : field.mass) {
    double sum = 0;
    for (const double m : mass) sum += m;
    EXPECT_NEAR(sum, 2, 1e-12);
  }
}

TEST(DensityGrid, ErrorIsZeroForTheSameAndTwoForDisjointClouds) {
  const Scene scene = unit_scene();
  const DensityGrid grid(scene.domain);
  const auto points = block(8, {0.2f, 0.2f, 0.2f}, 0.2f);
  const std::vector<int32_t> type(points.size(), 5);
  const auto truth = make_run(points, type, 1, stay);
  const auto away = make_run(points, type, 1, [](const Vec3f& x, std::size_t) { return x + Vec3f{0.4f, 0, 0}; });
  const auto a = grid.spread(truth, 1, {5}), b = grid.spread(away, 1, {5});
  EXPECT_EQ(DensityGrid::relative_l1(a, a), 0);
  EXPECT_NEAR(DensityGrid::relative_l1(a, b), 2, 1e-12);
  EXPECT_EQ(DensityGrid::occupancy_iou(a, a), 1);
  EXPECT_EQ(DensityGrid::occupancy_iou(a, b), 0);
}

TEST(DensityGrid, SeesSwappedMaterials) {
  const Scene scene = unit_scene();
  const DensityGrid grid(scene.domain);
  const auto truth = make_run(two_points, {5, 6}, 1, stay), swapped = make_run(two_points, {6, 5}, 1, stay);
  const auto a = grid.spread(truth, 1, {5, 6}), b = grid.spread(swapped, 1, {5, 6});
  EXPECT_NEAR(DensityGrid::relative_l1(a, b), 2, 1e-12);
  EXPECT_EQ(DensityGrid::occupancy_iou(a, b), 1);
}

TEST(DensityGrid, HalfASlabShared) {
  // Two slabs on whole nodes, shifted by half their thickness: half of each is shared.
  DensityGrid::Field a{{{1, 1, 0}}, {1, 1, 0}}, b{{{0, 1, 1}}, {0, 1, 1}};
  EXPECT_NEAR(DensityGrid::relative_l1(a, b), 1, 1e-12);
  EXPECT_NEAR(DensityGrid::occupancy_iou(a, b), 1.0 / 3, 1e-12);
}

TEST(KineticEnergy, OfParticlesMovingUniformly) {
  const auto run = make_run(two_points, two_types, 3, [](const Vec3f& x, std::size_t f) {
    return x + Vec3f{0.05f * static_cast<float>(f), 0, 0};
  });
  for (const double e : kinetic_energy_curve(run)) EXPECT_NEAR(e, 0.5 * 2 * 2 * 9, 1e-3);  // 0.05 m a frame = 3 m/s
}

TEST(KineticEnergy, ErrorIsRelativeToTheTruthsMaximum) {
  const auto e = kinetic_energy_error({1, 4, 2}, {2, 3, 2}, 1e-9);
  EXPECT_NEAR(e.relative, (1 + 1 + 0) / 3.0 / 4, 1e-12);
  EXPECT_NEAR(e.mean_squared, 2.0 / 3, 1e-12);
  EXPECT_NEAR(kinetic_energy_error({0, 0}, {3, 1}, 4).relative, 0.5, 1e-12);  // a truth at rest
}

TEST(MaterialShape, CentreOfMassIsWeighted) {
  auto run = make_run({{0, 0, 0}, {1, 0, 0}, {0, 4, 0}}, {5, 5, 6}, 1, stay);
  run.mass = {1, 3, 2};
  EXPECT_NEAR(center_of_mass(run, 1, 5)[0], 0.75, 1e-12);
  EXPECT_NEAR(center_of_mass(run, 1, 6)[1], 4, 1e-12);
  EXPECT_NEAR(center_of_mass(run, 1)[0], 0.5, 1e-12);
}

TEST(DisplacementError, OfTwoParticlesByHand) {
  DisplacementError error({{1, 0, 0}, {0, 2, 0}});
  error.add({{1, 1, 0}, {0, 2, 0}}, std::vector<Vec3f>{{1, 1, 3}, {0, 2, 0}});   // off by 3; moved by 1 and 0
  error.add({{1, 2, 0}, {0, 0, 0}}, std::vector<Vec3d>{{1, 2, 0}, {0, -4, 0}});  // off by 4; moved by 2 and 2
  EXPECT_NEAR(error.delta(), std::sqrt((9. + 16) / (2 + 4 + 5 + 0)), 1e-12);
  EXPECT_NEAR(error.displacement_relative(), std::sqrt((9. + 16) / (1 + 4 + 4)), 1e-12);
  EXPECT_NEAR(error.root_mean_square(), 2.5, 1e-12);
}

TEST(DisplacementError, OfATruthAtRestIsZero) {
  DisplacementError error({{1, 0, 0}});
  error.add({{1, 0, 0}}, std::vector<Vec3f>{{1, 1, 0}});
  EXPECT_EQ(error.displacement_relative(), 0);
  EXPECT_NEAR(error.delta(), 1, 1e-12);
}

TEST(MaterialShape, FrontIsThe99thPercentileOfTheHorizontalDistance) {
  std::vector<Vec3f> points;
  for (int i = 0; i <= 100; ++i) points.push_back({0.01f * static_cast<float>(i), static_cast<float>(i), 0});
  const auto run = make_run(points, std::vector<int32_t>(101, 6), 1, stay);
  EXPECT_NEAR(front_distance(run, 1, 6, {0, 0, 0}, 1), 0.99, 1e-6);
  EXPECT_EQ(front_distance(run, 1, 5, {0, 0, 0}, 1), 0);
}

TEST(Containment, MeasuresDepthInsideASphere) {
  const Scene scene = scene_with_sphere();
  const sparsegrid::ObstacleSet obstacles(scene);
  // Depths 0.05, 0.01 and none; one of four particles is outside the domain, and beyond the walls with it.
  const std::vector<Vec3f> points = {{0.5f, 0.4f, 0.5f}, {0.64f, 0.3f, 0.5f}, {0.3f, 0.7f, 0.3f}, {1.2f, 0.5f, 0.5f}};
  const auto run = make_run(points, {5, 5, 5, 5}, 2, stay);
  const Containment c = containment(scene, obstacles, run);
  const double tolerance = 0.02 * scene.domain.dx;
  EXPECT_NEAR(c.max_depth, 0.05, tolerance);
  EXPECT_NEAR(c.mean_depth, (0.05 + 0.01) / 4, tolerance);
  EXPECT_NEAR(c.inside_share, 0.5, 1e-12);
  EXPECT_NEAR(c.outside_walls, 0.25, 1e-12);
  EXPECT_EQ(c.most_outside_domain, 1);
}

TEST(Containment, ClearanceIsToTheNearerOfWallAndObstacle) {
  const Scene scene = scene_with_sphere();
  const sparsegrid::ObstacleSet obstacles(scene);
  const double wall = 3.0 / 32;
  const auto clearance = clearances(scene, obstacles, {{0.5f, 0.47f, 0.5f}, {0.5f, 0.9f, 0.12f}});
  EXPECT_NEAR(clearance[0], 0.02, 0.02 * scene.domain.dx);
  EXPECT_NEAR(clearance[1], std::min(0.12 - wall, 1 - wall - 0.9), 1e-6);
}

TEST(VerticalAxis, FollowsGravity) {
  EXPECT_EQ(vertical_axis({0, -9.8, 0}), 1);
  EXPECT_EQ(vertical_axis({0, 0, -9.8}), 2);
  EXPECT_EQ(vertical_axis({0, 0, 0}), 1);
}

}  // namespace
}  // namespace graupel::compare
