#include "core/math/polar.h"

#include <gtest/gtest.h>

#include "core/math/random.h"
#include "core/math/svd.h"

namespace graupel {
namespace {

template <typename T>
class PolarTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(PolarTest, Scalars);

template <typename T>
T largest_difference(const Mat<T, 3>& x, const Mat<T, 3>& y) {
  T worst = 0;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(x(r, c) - y(r, c)));
  return worst;
}

TYPED_TEST(PolarTest, EqualsTheRotationOfTheSingularVectors) {
  using T = TypeParam;
  const Random random(11, RandomPurpose::test, 3);
  int checked = 0;
  for (uint64_t i = 0; i < 500; ++i) {
    Mat<T, 3> F = Mat<T, 3>::identity();
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        F(r, c) += static_cast<T>(random.uniform(i * 16 + static_cast<uint64_t>(r * 3 + c), 0, -0.8, 0.8));
    const Svd<T, 3> d = svd(F);
    if (d.sigma[2] < T(0.05)) continue;  // near a singular F the rotation is ill-conditioned
    ++checked;
    EXPECT_LT(largest_difference(polar_rotation(F), d.U * transpose(d.V)), sizeof(T) == 4 ? T(1e-5) : T(1e-13));
  }
  EXPECT_GT(checked, 300);
}

TYPED_TEST(PolarTest, StretchesOfEverySizeLeaveTheRotation) {
  using T = TypeParam;
  const Mat<T, 3> R = rotation_about(normalized(Vec<T, 3>{1, 2, -1}), T(2.5));
  for (const T size : {T(1e-3), T(1), T(1e3)})
    for (const T ratio : {T(1), T(1.0001), T(20)}) {
      const Mat<T, 3> S = Mat<T, 3>::diagonal({size * ratio, size, size / ratio});
      EXPECT_LT(largest_difference(polar_rotation(R * S), R), sizeof(T) == 4 ? T(2e-5) : T(1e-12)) << size << ratio;
    }
}

TYPED_TEST(PolarTest, AnInvertedMatrixGivesTheIdentity) {
  using T = TypeParam;
  EXPECT_EQ(largest_difference(polar_rotation(Mat<T, 3>::diagonal({1, 1, -1})), Mat<T, 3>::identity()), T(0));
  EXPECT_EQ(largest_difference(polar_rotation(Mat<T, 3>::zero()), Mat<T, 3>::identity()), T(0));
}

}  // namespace
}  // namespace graupel
