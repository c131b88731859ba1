#include "mpm/bspline.h"

#include <gtest/gtest.h>

namespace graupel::mpm {
namespace {

TEST(Bspline, WeightsSumToOneWithZeroFirstAndQuarterSecondMoment) {
  for (int i = 0; i <= 100; ++i) {
    const double fx = 0.5 + i / 100.0;
    const auto weights = bspline_weights(fx);
    double sum = 0, first = 0, second = 0;
    for (int k = 0; k < stencil_width<>; ++k) {
      EXPECT_GE(weights.w[k], 0);
      sum += weights.w[k];
      first += weights.w[k] * (k - fx);
      second += weights.w[k] * (k - fx) * (k - fx);
      EXPECT_NEAR(weights.w[k], bspline(k - fx), 1e-15);
    }
    EXPECT_NEAR(sum, 1, 1e-15);
    EXPECT_NEAR(first, 0, 1e-15);
    EXPECT_NEAR(second, 0.25, 1e-15);
  }
}

TEST(Bspline, GradientsSumToZeroAndToTheUnitSlope) {
  const double h = 1e-6;
  for (const double fx : {0.6, 0.9, 1.0, 1.3, 1.49}) {
    const auto low = bspline_weights(fx - h), high = bspline_weights(fx + h);
    double sum = 0, slope = 0;
    for (int k = 0; k < stencil_width<>; ++k) {
      const double gradient = (high.w[k] - low.w[k]) / (2 * h);
      sum += gradient;
      slope += gradient * k;
    }
    EXPECT_NEAR(sum, 0, 1e-9);
    EXPECT_NEAR(slope, 1, 1e-9);
  }
}

TEST(Bspline, SupportEndsAtThreeHalvesAndTheBaseIsTheLowestNodeInIt) {
  EXPECT_EQ(bspline(1.5), 0);
  EXPECT_GT(bspline(1.4999), 0);
  const auto base = base_node(Vec<double, 2>{3.49, 3.51});
  EXPECT_EQ(base[0], 2);
  EXPECT_EQ(base[1], 3);
}

}  // namespace
}  // namespace graupel::mpm
