#include "mpm/physics/stencil.h"

#include <gtest/gtest.h>

namespace graupel::mpm {
namespace {

template <Spline S>
void check_moments(double moment) {
  for (int i = 0; i <= 100; ++i) {
    const double fx = BSpline<S>::base_shift + i / 100.0;
    const auto weights = bspline_weights<S>(fx);
    double sum = 0, first = 0, second = 0;
    for (int k = 0; k < stencil_width<S>; ++k) {
      EXPECT_GE(weights.w[k], 0);
      sum += weights.w[k];
      first += weights.w[k] * (k - fx);
      second += weights.w[k] * (k - fx) * (k - fx);
      EXPECT_NEAR(weights.w[k], bspline<S>(k - fx), 1e-15);
    }
    EXPECT_NEAR(sum, 1, 1e-15);
    EXPECT_NEAR(first, 0, 1e-15);
    EXPECT_NEAR(second, moment, 1e-15);
    EXPECT_NEAR(second * inverse_moment(S), 1, 1e-14);
  }
}

TEST(Bspline, WeightsSumToOneWithZeroFirstAndConstantSecondMoment) {
  check_moments<Spline::quadratic>(0.25);
  check_moments<Spline::cubic>(1.0 / 3);
}

template <Spline S>
void check_gradients() {
  const double h = 1e-6;
  for (const double fraction : {0.1, 0.4, 0.5, 0.8, 0.99}) {
    const double fx = BSpline<S>::base_shift + fraction;
    const auto low = bspline_weights<S>(fx - h), high = bspline_weights<S>(fx + h);
    double sum = 0, slope = 0;
    for (int k = 0; k < stencil_width<S>; ++k) {
      const double gradient = (high.w[k] - low.w[k]) / (2 * h);
      sum += gradient;
      slope += gradient * k;
    }
    EXPECT_NEAR(sum, 0, 1e-9);
    EXPECT_NEAR(slope, 1, 1e-9);
  }
}

TEST(Bspline, GradientsSumToZeroAndToTheUnitSlope) {
  check_gradients<Spline::quadratic>();
  check_gradients<Spline::cubic>();
}

TEST(Bspline, TheCubicSplineHasAContinuousCurvature) {
  const double h = 1e-3;
  const auto curvature = [&](double u) {
    return (bspline<Spline::cubic>(u + h) - 2 * bspline<Spline::cubic>(u) + bspline<Spline::cubic>(u - h)) / (h * h);
  };
  for (const double u : {0.0, 1.0, 2.0}) EXPECT_NEAR(curvature(u - 2 * h), curvature(u + 2 * h), 20 * h) << u;
}

TEST(Bspline, SupportsEndWhereTheyShouldAndTheBaseIsTheLowestNodeInThem) {
  EXPECT_EQ(bspline(1.5), 0);
  EXPECT_GT(bspline(1.4999), 0);
  EXPECT_EQ(bspline<Spline::cubic>(2.0), 0);
  EXPECT_GT(bspline<Spline::cubic>(1.999), 0);
  const auto base = base_node(Vec<double, 2>{3.49, 3.51});
  EXPECT_EQ(base[0], 2);
  EXPECT_EQ(base[1], 3);
  const auto cubic = base_node<Spline::cubic>(Vec<double, 2>{3.99, 4.01});
  EXPECT_EQ(cubic[0], 2);
  EXPECT_EQ(cubic[1], 3);
}

}  // namespace
}  // namespace graupel::mpm
