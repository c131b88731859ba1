#include "core/math/random.h"

#include <Random123/philox.h>
#include <gtest/gtest.h>

namespace graupel {
namespace {

TEST(Random, SameKeySameNumbersAndDifferentKeysDiffer) {
  const Random a(1, RandomPurpose::test, 3), b(1, RandomPurpose::test, 3), c(1, RandomPurpose::test, 4),
      d(2, RandomPurpose::test, 3), e(1, RandomPurpose::scene_layout, 3);
  EXPECT_EQ(a.uniform(5), b.uniform(5));
  EXPECT_NE(a.uniform(5), c.uniform(5));
  EXPECT_NE(a.uniform(5), d.uniform(5));
  EXPECT_NE(a.uniform(5), e.uniform(5));
  EXPECT_NE(a.uniform(5, 0), a.uniform(5, 1));
}

TEST(Random, MomentsOfUniformAndNormal) {
  const Random random(42, RandomPurpose::test);
  const int n = 100000;
  double sum = 0, squares = 0, normal_sum = 0, normal_squares = 0;
  for (int i = 0; i < n; ++i) {
    const double u = random.uniform(i, 0);
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    sum += u;
    squares += u * u;
    double x, y;
    random.normal(i, 1, x, y);
    normal_sum += x + y;
    normal_squares += x * x + y * y;
    ASSERT_LT(random.integer(i, 2, 7), 7u);
  }
  EXPECT_NEAR(sum / n, 0.5, 0.005);
  EXPECT_NEAR(squares / n, 1.0 / 3, 0.005);
  EXPECT_NEAR(normal_sum / (2 * n), 0, 0.01);
  EXPECT_NEAR(normal_squares / (2 * n), 1, 0.02);
}

TEST(Random, WordsAreThoseOfRandom123) {
  const Random random(0x0123456789ABCDEFu, RandomPurpose::emission, 0xFEDCBA9876543210u);
  const r123::Philox4x32::key_type key = {{0x89ABCDEFu, 0x01234567u ^ (10u * 0x9E3779B9u)}};
  for (uint64_t index : {uint64_t{0}, uint64_t{1}, uint64_t{77777}, ~uint64_t{0}}) {
    const auto low = static_cast<uint32_t>(index), high = static_cast<uint32_t>(index >> 32);
    const auto expected = r123::Philox4x32()({{low, high, 0x76543210u, 0xFEDCBA98u}}, key);
    for (int c = 0; c < 4; ++c) EXPECT_EQ(random.words(index).v[c], expected.v[c]) << index << " " << c;
  }
}

}  // namespace
}  // namespace graupel
