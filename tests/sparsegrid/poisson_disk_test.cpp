#include "sparsegrid/poisson_disk.h"

#include <gtest/gtest.h>

#include "core/math/random.h"

namespace graupel::sparsegrid {
namespace {

/// n points in a box of four tiles an axis about the origin, in pieces of 100 neighbours in number.
PoissonDisk::Pieces random_points(uint64_t n, double distance, uint64_t seed) {
  const Random random(seed, RandomPurpose::surface_sample, 0);
  PoissonDisk::Pieces pieces;
  for (uint64_t i = 0; i < n; ++i) {
    if (i % 100 == 0) pieces.emplace_back();
    Vec3d x;
    for (int d = 0; d < 3; ++d) x[d] = (random.uniform(i, d) - 0.5) * 60 * distance;
    pieces.back().push_back(x);
  }
  return pieces;
}

double nearest(const std::vector<Vec3d>& points, const Vec3d& x) {
  double least = 1e30;
  for (const Vec3d& p : points)
    if (!(p == x)) least = std::min(least, norm(p - x));
  return least;
}

TEST(PoissonDisk, TakesWhatIsFarFromAllThatIsTakenAndNothingElse) {
  const double distance = 0.02;
  PoissonDisk board(distance);
  std::vector<Vec3d> taken, refused;
  for (const uint64_t seed : {1, 2}) {
    const PoissonDisk::Pieces candidates = random_points(20000, distance, seed);
    const auto answer = board.take(candidates);
    for (std::size_t piece = 0; piece < answer.size(); ++piece)
      for (std::size_t i = 0; i < answer[piece].size(); ++i)
        (answer[piece][i] ? taken : refused).push_back(candidates[piece][i]);
  }
  ASSERT_GT(refused.size(), 1000u);
  ASSERT_GT(taken.size(), 10000u);
  for (std::size_t i = 0; i < taken.size(); i += 7) EXPECT_GE(nearest(taken, taken[i]), distance);
  for (std::size_t i = 0; i < refused.size(); i += 7) EXPECT_LT(nearest(taken, refused[i]), distance);
}

TEST(PoissonDisk, PointsOnTheBordersOfTilesAreHeldToo) {
  PoissonDisk board(1);
  // Tiles are 16 wide: two points on both sides of a corner, one on it, and one beyond the distance.
  const auto answer = board.take({{{-0.4, -0.4, -0.4}, {0.1, 0.1, 0.1}, {0, 0, 0}, {16, 16, 16}, {15.5, 15.9, 16.2}}});
  EXPECT_EQ(answer[0][0] + answer[0][1] + answer[0][2], 1);
  EXPECT_EQ(answer[0][3] + answer[0][4], 1);
}

}  // namespace
}  // namespace graupel::sparsegrid
