// The distances are exact: they never differ by more than the way between two points, and a step of that length along
// the gradient ends on the surface. Together these two laws leave no other function.
#include "sparsegrid/analytic_shape.h"

#include <gtest/gtest.h>

#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

Vec3d gradient_of(const Body& body, const Vec3d& x) {
  Vec3d g;
  for (int d = 0; d < 3; ++d) {
    Vec3d step = Vec3d::zero();
    step[d] = 1e-6;
    g[d] = (analytic_distance(body, x + step) - analytic_distance(body, x - step)) / 2e-6;
  }
  return g;
}

TEST(AnalyticShape, IsAnExactDistance) {
  const Random random(1, RandomPurpose::test);
  for (const Shape shape : solid_shapes) {
    const Body body = make_obstacle(shape, {0, 0, 0});
    int smooth = 0;
    for (uint64_t i = 0; i < 4000; ++i) {
      const Vec3d x = random_point(random, 2 * i, -0.4, 0.4), y = random_point(random, 2 * i + 1, -0.4, 0.4);
      const double phi = analytic_distance(body, x);
      ASSERT_LE(std::abs(phi - analytic_distance(body, y)), norm(x - y) + 1e-12) << word_of(shape);
      const Vec3d gradient = gradient_of(body, x);
      if (std::abs(norm(gradient) - 1) > 1e-6) continue;  // on the medial axis
      ++smooth;
      ASSERT_NEAR(analytic_distance(body, x - gradient * phi), 0, 1e-6) << word_of(shape);
    }
    EXPECT_GT(smooth, 3900) << word_of(shape);
  }
}

TEST(AnalyticShape, KnownValues) {
  Body body = make_obstacle(Shape::box, {0, 0, 0});
  body.size = {2, 4, 6};
  EXPECT_DOUBLE_EQ(analytic_distance(body, {4, 6, 3}), 5);  // edge: (3, 4, 0) away
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 0, 0}), -1);
  body.shape = Shape::half_box;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 1, 0}), 1);
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, -0.25, 0}), -0.25);
  EXPECT_DOUBLE_EQ(analytic_distance(body, {4, 4, 3}), 5);
  body.shape = Shape::half_sphere;
  body.radius = 2;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, -1, 0}), 1);
  EXPECT_DOUBLE_EQ(analytic_distance(body, {5, -4, 0}), 5);  // the rim
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 0.5, 0}), -0.5);
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 0, 3}), 1);
  body.shape = Shape::cylinder;
  body.height = 2;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 5, 5}), 5);
  body.shape = Shape::cone;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 4, 0}), 3);
  EXPECT_NEAR(analytic_distance(body, {0, 0, 0}), -1 / std::sqrt(2.0), 1e-12);  // side of slope 2 over 2
  body.shape = Shape::pyramid;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {0, 4, 0}), 3);
  EXPECT_DOUBLE_EQ(analytic_distance(body, {1 + 3, -1 - 4, 0}), 5);
  EXPECT_NEAR(analytic_distance(body, {1, -1, 3}), 0, 1e-12);
  body.shape = Shape::plane;
  EXPECT_DOUBLE_EQ(analytic_distance(body, {7, -3, 9}), -3);
}

TEST(AnalyticShape, BoundsHoldTheSurfaceAndNoMore) {
  const Random random(2, RandomPurpose::test);
  for (const Shape shape : solid_shapes) {
    const Body body = make_obstacle(shape, {0, 0, 0});
    const LocalBox box = analytic_bounds(body);
    Vec3d low = Vec3d::filled(1), high = Vec3d::filled(-1);
    for (uint64_t i = 0; i < 200000; ++i) {
      const Vec3d x = random_point(random, i, -0.2, 0.2);
      if (analytic_distance(body, x) > 0) continue;
      for (int d = 0; d < 3; ++d) {
        low[d] = std::min(low[d], x[d]);
        high[d] = std::max(high[d], x[d]);
      }
    }
    for (int d = 0; d < 3; ++d) {
      EXPECT_GE(low[d], box.low[d]) << word_of(shape);
      EXPECT_LE(high[d], box.high[d]) << word_of(shape);
      EXPECT_NEAR(low[d], box.low[d], 0.02) << word_of(shape);
      EXPECT_NEAR(high[d], box.high[d], 0.02) << word_of(shape);
    }
  }
}

}  // namespace
}  // namespace graupel::sparsegrid
