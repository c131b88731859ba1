// Distributions of clump sizes and local density, on shapes whose answer is known: they see what a lump has become.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "compare/metrics/clumps.h"
#include "compare/metrics/evaluation.h"
#include "compare/metrics/local_density.h"
#include "compare/metrics/wasserstein.h"
#include "core/math/random.h"
#include "tests/compare/synthetic_run.h"

namespace graupel::compare {
namespace {

constexpr double spacing = 1.0 / 32;  // of the unit scene's grid

TEST(Wasserstein, OfPointsIsTheirDistance) {
  EXPECT_DOUBLE_EQ(wasserstein_1({{1}, {5}}, {{3}, {0.1}}), 2);
  EXPECT_DOUBLE_EQ(wasserstein_1({{1, 2}, {1, 1}}, {{2, 1}, {3, 3}}), 0);
  EXPECT_DOUBLE_EQ(wasserstein_1({{0, 1}, {1, 1}}, {{0, 1}, {1, 3}}), 0.25);  // a quarter moves by 1
  EXPECT_DOUBLE_EQ(wasserstein_1({{0, 1, 2}, {1, 1, 1}}, {{5}, {7}}), 4);     // 5 + 4 + 3 over 3
  EXPECT_EQ(wasserstein_1({}, {}), 0);
  EXPECT_TRUE(std::isinf(wasserstein_1({{1}, {1}}, {})));
}

TEST(Clumps, AreChainsOfNeighbours) {
  // 0-1-2 is a chain, 3 lies apart, 4-5 are a pair across a corner of cells and of negative coordinates.
  const std::vector<Vec3f> x = {
      {0, 0, 0}, {0.9f, 0, 0}, {1.8f, 0, 0}, {1.8f, 1.1f, 0}, {-5.01f, -5.01f, -5.01f}, {-4.99f, -4.99f, -4.99f}};
  const auto clumps = clump_masses(x, {1, 2, 3, 10, 20, 40}, 1);
  EXPECT_EQ(clumps, (std::vector<double>{6, 10, 60}));
  EXPECT_EQ(clump_masses(x, {1, 2, 3, 10, 20, 40}, 1.2), (std::vector<double>{16, 60}));
  EXPECT_TRUE(clump_masses({}, {}, 1).empty());
}

TEST(Clumps, EqualThoseOfAllPairs) {
  std::vector<Vec3f> x;
  for (uint64_t i = 0; i < 300; ++i) {
    const Random random(7, RandomPurpose::metric_subset, i);
    x.push_back({float(random.uniform(0)), float(random.uniform(1)), float(random.uniform(2))});
  }
  const double radius = 0.09;
  std::vector<std::size_t> group(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) group[i] = i;
  for (bool more = true; more;) {
    more = false;
    for (std::size_t i = 0; i < x.size(); ++i)
      for (std::size_t j = 0; j < x.size(); ++j)
        if (group[j] < group[i] && norm2(x[i].cast<double>() - x[j].cast<double>()) <= radius * radius) {
          group[i] = group[j];
          more = true;
        }
  }
  std::map<std::size_t, double> expected;
  for (const std::size_t g : group) expected[g] += 1;
  std::vector<double> masses;
  for (const auto& [first, mass] : expected) masses.push_back(mass);
  EXPECT_GT(masses.size(), 20u);
  EXPECT_LT(masses.size(), 250u);
  EXPECT_EQ(clump_masses(x, std::vector<double>(x.size(), 1), radius), masses);
}

TEST(Clumps, TenPiecesAreADecade) {
  const std::vector<double> whole = {10}, pieces(10, 1.0);
  EXPECT_NEAR(wasserstein_1(clump_sizes(whole, 10), clump_sizes(pieces, 10)), 1, 1e-12);
  // A tenth of the mass in dust of a thousandth: 0.1 * 3 decades, and the rest is a little smaller.
  std::vector<double> dust(100, 0.01);
  dust.push_back(9);
  EXPECT_NEAR(wasserstein_1(clump_sizes(whole, 10), clump_sizes(dust, 10)), 0.1 * 3 - 0.9 * std::log10(0.9), 1e-12);
}

/// Lattice points, half a grid spacing apart as eight particles a cell are, inside a body.
template <typename Inside>
std::vector<Vec3d> fill_body(const Inside& inside) {
  std::vector<Vec3d> points;
  const double h = spacing / 2;
  for (int i = -40; i < 40; ++i)
    for (int j = -40; j < 40; ++j)
      for (int k = -40; k < 40; ++k)
        if (const Vec3d x = {(i + 0.5) * h, (j + 0.5) * h, (k + 0.5) * h}; inside(x)) points.push_back(x);
  return points;
}

/// Balls of snow, 3 x 3 on a floor, and the same with each ball turned into another body of as many particles.
ParticleRun balls_and(const std::vector<Vec3d>& ball, const std::vector<Vec3d>& later) {
  std::vector<Vec3f> start, end;
  for (const double x : {0.25, 0.5, 0.75})
    for (const double z : {0.25, 0.5, 0.75}) {
      const Vec3d centre = {x, 0.3, z};
      for (const Vec3d& p : ball) start.push_back((centre + p).cast<float>());
      for (const Vec3d& p : later) end.push_back((centre + p).cast<float>());
    }
  ParticleRun run = make_run(start, std::vector<int32_t>(start.size(), 7), 1, stay);
  run.trajectory.frames[1].position = end;
  run.volume.assign(start.size(), std::pow(spacing / 2, 3));
  return run;
}

/// The same number of points on a rope around the centre, one grid spacing thick, broken into pieces or not.
std::vector<Vec3d> ring(std::size_t points, double radius, double thickness, bool broken) {
  std::vector<Vec3d> rope;
  for (std::size_t i = 0; i < points; ++i) {
    const Random random(3, RandomPurpose::metric_subset, i);
    double angle = 2 * M_PI * random.uniform(0);
    if (broken) angle = (std::floor(angle / (2 * M_PI) * 6) + 0.5 * random.uniform(0)) / 6 * 2 * M_PI;
    const double out = radius + thickness * (random.uniform(1) - 0.5), up = thickness * (random.uniform(2) - 0.5);
    rope.push_back({out * std::cos(angle), up, out * std::sin(angle)});
  }
  Vec3d centre = {0, 0, 0};
  for (const Vec3d& p : rope) centre += p * (1 / double(points));
  for (Vec3d& p : rope) p -= centre;
  return rope;
}

TEST(Distributions, SeeALumpBecomeARope) {
  const Scene scene = unit_scene();
  const auto ball = fill_body([](const Vec3d& x) { return norm(x) < 2.4 * spacing; });
  const ParticleRun truth = balls_and(ball, ball);
  const auto values = [&](const std::vector<Vec3d>& later) {
    return evaluate_rollout(scene, {}, truth, balls_and(ball, later)).values;
  };
  auto aside = ball;  // what all agree to be a small error
  for (Vec3d& p : aside) p += Vec3d{spacing, 0, 0};
  const auto shifted = values(aside), rope = values(ring(ball.size(), 2 * spacing, 0.7 * spacing, false)),
             pieces = values(ring(ball.size(), 2 * spacing, 0.7 * spacing, true));
  for (const auto& changed : {rope, pieces}) {
    EXPECT_LT(changed.at("center_of_mass_error"), 1e-6);
    EXPECT_LT(changed.at("sinkhorn"), 0.25 * shifted.at("sinkhorn"));  // its blur is as wide as a ball
    EXPECT_GT(changed.at("local_density_error"), 0.3);
  }
  EXPECT_LT(shifted.at("local_density_error"), 1e-3);
  EXPECT_EQ(shifted.at("clump_size_error"), 0);
  EXPECT_EQ(shifted.at("clumps"), 9);
  EXPECT_EQ(rope.at("clump_size_error"), 0);  // still in one piece
  EXPECT_EQ(pieces.at("clumps_truth"), 9);
  EXPECT_GT(pieces.at("clumps"), 9 * 4);
  EXPECT_GT(pieces.at("clump_size_error"), 0.5);
}

TEST(LocalDensity, OfALatticeIsOneInsideAndLessAtItsFaces) {
  const auto points = block(8, {0.25f, 0.25f, 0.25f}, 8 * 0.5f / 32);  // 4^3 cells of the grid, eight points in each
  const std::vector<double> volume(points.size(), std::pow(spacing / 2, 3));
  const Distribution density = local_density(points, volume, spacing);
  EXPECT_EQ(density.value.size(), 125u);  // corners hold an eighth, above a tenth
  EXPECT_EQ(std::count_if(density.value.begin(), density.value.end(), [](double v) { return std::abs(v - 1) < 1e-6; }),
            27);
  EXPECT_EQ(wasserstein_1(density, density), 0);
  const Distribution none = local_density({}, {}, spacing);
  EXPECT_EQ(none.value, std::vector<double>{0});
}

TEST(MaterialOccupancy, SeesSwappedMaterials) {
  const auto first = block(6, {0.2f, 0.3f, 0.2f}, 0.1f), second = block(6, {0.6f, 0.3f, 0.6f}, 0.1f);
  auto points = first;
  points.insert(points.end(), second.begin(), second.end());
  std::vector<int32_t> type(first.size(), 5);
  type.insert(type.end(), second.size(), 6);
  const ParticleRun truth = make_run(points, type, 1, stay);
  ParticleRun swapped = truth;
  std::rotate(swapped.trajectory.frames[1].position.begin(),
              swapped.trajectory.frames[1].position.begin() + std::ptrdiff_t(first.size()),
              swapped.trajectory.frames[1].position.end());
  const Evaluation e = evaluate_rollout(unit_scene(), {}, truth, swapped);
  EXPECT_EQ(e.values.at("occupancy_iou"), 1);
  EXPECT_EQ(e.values.at("material_occupancy_iou"), 0);
  EXPECT_EQ(e.materials.at("water").at("occupancy_iou"), 0);
  EXPECT_EQ(evaluate_rollout(unit_scene(), {}, truth, truth).values.at("material_occupancy_iou"), 1);
}

}  // namespace
}  // namespace graupel::compare
