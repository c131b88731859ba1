// Exponential, logarithm, rotations and eigenvectors of vectors, against the scalar ones.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/polar.h"
#include "core/math/svd.h"
#include "mpm/cpu/lanes_math.h"
#include "mpm/cpu/lanes_matrix.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T>
void check_logarithm_and_exponential() {
  const double eps = std::numeric_limits<T>::epsilon();
  for (int i = -2000; i <= 2000; ++i) {
    const T x = static_cast<T>(std::exp2(i * 0.01 * (sizeof(T) == 4 ? 1 : 10)));
    const double log_x = std::log(static_cast<double>(x));
    EXPECT_NEAR(logarithm<T>(splat(x))[0], log_x, 2 * eps * std::abs(log_x)) << x;
    const T near_1 = T(1) + static_cast<T>(i * 1e-5);
    const double log_near_1 = std::log(static_cast<double>(near_1));
    EXPECT_NEAR(logarithm<T>(splat(near_1))[0], log_near_1, 2 * eps * std::abs(log_near_1)) << near_1;
    const T y = static_cast<T>(i * (sizeof(T) == 4 ? 0.04 : 0.35));
    const double exp_y = std::exp(static_cast<double>(y));
    EXPECT_NEAR(exponential<T>(splat(y))[0], exp_y, 2 * eps * exp_y) << y;
  }
}

TEST(LanesMath, LogarithmAndExponentialAreExactToTwoUnits) {
  check_logarithm_and_exponential<float>();
  check_logarithm_and_exponential<double>();
}

template <typename T>
void check_rotation(double scale) {
  const T tolerance = sizeof(T) == 4 ? T(3e-6) : T(3e-14);
  for (uint64_t i = 0; i < 200; ++i) {
    const Mat<T, 3> F = Mat<T, 3>::identity() + random_matrix<T, 3>(i, scale);
    if (!(determinant(F) > T(0.05))) continue;
    LaneMatrix<T> lanes;
    for (int k = 0; k < 9; ++k) lanes.m[k / 3][k % 3] = splat(F(k / 3, k % 3));
    const LaneMatrix<T> R = rotation_of(lanes);
    const Mat<T, 3> expected = polar_rotation(F);
    for (int k = 0; k < 9; ++k) ASSERT_NEAR(R.m[k / 3][k % 3][0], expected(k / 3, k % 3), tolerance);
  }
}

TEST(LanesMath, RotationsEqualTheScalarOnesNearAndFarFromTheIdentity) {
  for (const double scale : {0.01, 0.2, 0.8}) {
    check_rotation<float>(scale);
    check_rotation<double>(scale);
  }
}

template <typename T>
void check_eigenvectors(double scale) {
  const T tolerance = sizeof(T) == 4 ? T(2e-6) : T(1e-14);
  for (uint64_t i = 0; i < 200; ++i) {
    LaneMatrix<T> F;
    const Mat<T, 3> one = Mat<T, 3>::identity() + random_matrix<T, 3>(i, scale);
    for (int k = 0; k < 9; ++k) F.m[k / 3][k % 3] = splat(one(k / 3, k % 3));
    const LaneSymmetric<T> b = left_stretch2(F);
    LaneSymmetric<T> values = b;
    const LaneMatrix<T> U = eigenvectors(values);
    const Lanes<T> spectrum[3] = {values.s[0], values.s[1], values.s[2]},
                   ones[3] = {splat(T(1)), splat(T(1)), splat(T(1))};
    const LaneSymmetric<T> again = from_spectrum<T>(U, spectrum), identity = from_spectrum<T>(U, ones);
    for (int k = 0; k < 6; ++k) {
      ASSERT_NEAR(again.s[k][0], b.s[k][0], tolerance * (T(1) + std::abs(b.s[k][0])) * 3);
      ASSERT_NEAR(identity.s[k][0], k < 3 ? 1 : 0, tolerance);
    }
  }
}

TEST(LanesMath, EigenvectorsAreOrthogonalAndGiveTheMatrixBack) {
  for (const double scale : {0.0, 1e-3, 0.1, 0.8}) {
    check_eigenvectors<float>(scale);
    check_eigenvectors<double>(scale);
  }
}

}  // namespace
}  // namespace graupel::mpm
