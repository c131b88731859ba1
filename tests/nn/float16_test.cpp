#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "nn/weights.h"

namespace graupel::nn {
namespace {

TEST(Float16, KnownBitPatterns) {
  const struct {
    float value;
    uint16_t f16, bf16;
  } cases[] = {{0.0f, 0x0000, 0x0000},     {-0.0f, 0x8000, 0x8000},      {1.0f, 0x3C00, 0x3F80},
               {-2.5f, 0xC100, 0xC020},    {0.5f, 0x3800, 0x3F00},       {0x1p-14f, 0x0400, 0x3880},
               {0x1p-24f, 0x0001, 0x3380}, {0x1.8p-15f, 0x0300, 0x3840}, {INFINITY, 0x7C00, 0x7F80},
               {-INFINITY, 0xFC00, 0xFF80}};
  for (const auto& c : cases) {
    EXPECT_EQ(f16_from_float(c.value), c.f16) << c.value;
    EXPECT_EQ(bf16_from_float(c.value), c.bf16) << c.value;
    EXPECT_EQ(float_from_f16(c.f16), c.value);
    EXPECT_EQ(float_from_bf16(c.bf16), c.value);
  }
}

TEST(Float16, EveryPatternSurvivesWideningAndNarrowing) {
  for (uint32_t bits = 0; bits < 0x10000; ++bits) {
    const auto pattern = static_cast<uint16_t>(bits);
    const float half = float_from_f16(pattern), brain = float_from_bf16(pattern);
    if (std::isnan(half))
      EXPECT_TRUE(std::isnan(float_from_f16(f16_from_float(half))));
    else
      EXPECT_EQ(f16_from_float(half), pattern);
    if (std::isnan(brain))
      EXPECT_TRUE(std::isnan(float_from_bf16(bf16_from_float(brain))));
    else
      EXPECT_EQ(bf16_from_float(brain), pattern);
  }
}

TEST(Float16, RoundsToNearestTiesToEven) {
  EXPECT_EQ(f16_from_float(1.0f + 0x1p-11f), 0x3C00);    // halfway, even below
  EXPECT_EQ(f16_from_float(1.0f + 0x1.8p-10f), 0x3C02);  // halfway, even above
  EXPECT_EQ(f16_from_float(1.0f + 0x1.1p-11f), 0x3C01);  // above halfway
  EXPECT_EQ(f16_from_float(65519.0f), 0x7BFF);           // largest finite
  EXPECT_EQ(f16_from_float(65520.0f), 0x7C00);           // rounds to infinity
  EXPECT_EQ(f16_from_float(0x1p-25f), 0x0000);           // halfway to the smallest subnormal
  EXPECT_EQ(f16_from_float(0x1.8p-24f), 0x0002);
  EXPECT_EQ(f16_from_float(std::nextafter(0x1p-14f, 0.0f)), 0x0400);  // largest subnormals round up to normal
  EXPECT_EQ(bf16_from_float(1.0f + 0x1p-8f), 0x3F80);
  EXPECT_EQ(bf16_from_float(1.0f + 0x1.8p-7f), 0x3F82);
  EXPECT_EQ(bf16_from_float(std::numeric_limits<float>::max()), 0x7F80);
}

}  // namespace
}  // namespace graupel::nn
