#include "core/math/svd.h"

#include <gtest/gtest.h>

#include "core/math/random.h"

namespace graupel {
namespace {

template <typename T>
class SvdTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SvdTest, Scalars);

template <typename T, int D>
Mat<T, D> random_matrix(uint64_t i, double scale) {
  const Random random(7, RandomPurpose::test, D);
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) m(r, c) = static_cast<T>(scale * random.uniform(i * 16 + r * D + c, 0, -1, 1));
  return m;
}

template <typename T, int D>
T largest_difference(const Mat<T, D>& x, const Mat<T, D>& y) {
  T worst = 0;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) worst = std::max(worst, std::abs(x(r, c) - y(r, c)));
  return worst;
}

template <typename T, int D>
void check(const Mat<T, D>& F, T scale) {
  const T tolerance = (sizeof(T) == 4 ? T(5e-6) : T(1e-13));
  const auto d = svd(F);
  EXPECT_LT(largest_difference(d.U * Mat<T, D>::diagonal(d.sigma) * transpose(d.V), F), tolerance * scale);
  EXPECT_LT(largest_difference(transpose(d.U) * d.U, Mat<T, D>::identity()), tolerance);
  EXPECT_LT(largest_difference(transpose(d.V) * d.V, Mat<T, D>::identity()), tolerance);
  EXPECT_NEAR(determinant(d.U), T(1), tolerance);
  EXPECT_NEAR(determinant(d.V), T(1), tolerance);
  for (int i = 0; i + 1 < D; ++i) EXPECT_GE(d.sigma[i] + tolerance * scale, std::abs(d.sigma[i + 1]));
}

TYPED_TEST(SvdTest, RandomMatrices) {
  for (uint64_t i = 0; i < 500; ++i) {
    check<TypeParam, 3>(random_matrix<TypeParam, 3>(i, 2), TypeParam(2));
    check<TypeParam, 2>(random_matrix<TypeParam, 2>(i, 2), TypeParam(2));
  }
}

TYPED_TEST(SvdTest, NearIdentityRankDeficientAndInverted) {
  using T = TypeParam;
  check<T, 3>(Mat<T, 3>::identity(), T(1));
  check<T, 3>(Mat<T, 3>::zero(), T(1));
  check<T, 3>(outer(Vec<T, 3>{1, 2, 3}, Vec<T, 3>{-1, 0, 2}), T(8));
  check<T, 3>(Mat<T, 3>::diagonal({1, 1, -1}), T(1));
  check<T, 3>(Mat<T, 3>::diagonal({T(1e-3), T(1), T(50)}), T(50));
  EXPECT_LT(svd(Mat<T, 3>::diagonal({1, 1, -1})).sigma[2], T(0));
}

TYPED_TEST(SvdTest, PolarRotationOfARotatedStretchIsTheRotation) {
  using T = TypeParam;
  const auto R = rotation_about(normalized(Vec<T, 3>{1, 2, -1}), T(0.7));
  const auto S = Mat<T, 3>::diagonal({T(1.2), T(0.9), T(1.05)});
  const auto d = svd(R * S);
  EXPECT_LT(largest_difference(d.U * transpose(d.V), R), T(sizeof(T) == 4 ? 3e-6 : 1e-13));
}

}  // namespace
}  // namespace graupel
