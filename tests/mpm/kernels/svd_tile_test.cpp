#include "mpm/cpu/svd_tile.h"

#include <gtest/gtest.h>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T>
Mat<T, 3> test_matrix(int i) {
  switch (i % 8) {
    case 0:
      return Mat<T, 3>::identity();
    case 1:
      return Mat<T, 3>::zero();
    case 2:
      return outer(Vec<T, 3>{1, 2, 3}, Vec<T, 3>{-1, 0, 2});
    case 3:
      return Mat<T, 3>::diagonal({1, 1, -1});
    case 4:
      return Mat<T, 3>::identity() + random_matrix<T, 3>(i, 1e-3);
    case 5:
      return Mat<T, 3>::diagonal({T(1e-3), T(1), T(50)});
    default:
      return random_matrix<T, 3>(i, 2);
  }
}

template <typename T>
void check_tiles() {
  const T tolerance = sizeof(T) == 4 ? T(5e-6) : T(1e-12);
  for (int round = 0; round < 40; ++round) {
    MatrixTile<T> F;
    Mat<T, 3> one[tile];
    for (int l = 0; l < tile; ++l) {
      one[l] = test_matrix<T>(round * 16 + l * 3);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) F.m[r][c][l] = one[l](r, c);
    }
    SvdTile<T> result;
    svd_tile(F, result);
    for (int l = 0; l < tile; ++l) {
      const Svd<T, 3> d = result.lane(l), expected = svd(one[l]);
      const T scale = std::max(T(1), expected.sigma[0]);
      EXPECT_LT(largest_entry(d.U * Mat<T, 3>::diagonal(d.sigma) * transpose(d.V) - one[l]), tolerance * scale);
      EXPECT_LT(largest_entry(transpose(d.U) * d.U - Mat<T, 3>::identity()), 4 * tolerance);
      EXPECT_LT(largest_entry(transpose(d.V) * d.V - Mat<T, 3>::identity()), 4 * tolerance);
      EXPECT_GT(determinant(d.U), T(0.9));
      EXPECT_GT(determinant(d.V), T(0.9));
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(d.sigma[i], expected.sigma[i], tolerance * scale);
    }
  }
}

TEST(SvdTile, EqualsTheScalarDecomposition) {
  check_tiles<float>();
  check_tiles<double>();
}

}  // namespace
}  // namespace graupel::mpm
