// Products on units for bf16 are those of operands rounded to bf16, row by row, whatever the number and place of the
// rows.
#include "nn/bf16_gemm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "core/math/random.h"
#include "core/system/error.h"
#include "nn/linear.h"
#include "nn/weights.h"

namespace graupel::nn {
namespace {

class Bf16Gemm : public ::testing::TestWithParam<std::tuple<Bf16Extension, std::tuple<int, int, int>>> {
 protected:
  void SetUp() override {
    const Bf16Extension units = std::get<0>(GetParam());
    if (available_bf16_units() < units) GTEST_SKIP() << "this processor has no such units for bf16";
    use_bf16_units(units);
  }
  void TearDown() override { set_bf16_gemm(false); }
};

std::vector<float> random_values(std::size_t n, uint64_t stream) {
  const Random random(1, RandomPurpose::test, stream);
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<float>(random.uniform(i, 0, -1, 1));
  return values;
}

double rounded(float value) { return float_from_bf16(bf16_from_float(value)); }

TEST_P(Bf16Gemm, AreThoseOfRoundedOperands) {
  const auto [rows, in, out] = std::get<1>(GetParam());
  const int stride = in + 8;  // rows of a wider matrix
  const auto x = random_values(static_cast<std::size_t>(rows * stride), 1),
             weight = random_values(static_cast<std::size_t>(out * in), 2),
             bias = random_values(static_cast<std::size_t>(out), 3);
  const Linear linear(out, in, weight.data(), in, bias);
  const int width = linear.width(), y_stride = width + 32;
  constexpr float untouched = 77;
  std::vector<float> y(static_cast<std::size_t>((rows + 1) * y_stride), untouched);
  linear.apply(x.data(), stride, rows, y.data(), y_stride);
  for (int r = 0; r <= rows; ++r)
    for (int o = 0; o < y_stride; ++o) {
      const float value = y[static_cast<std::size_t>(r * y_stride + o)];
      if (r == rows || o >= width) {
        ASSERT_EQ(value, untouched) << r << " " << o;
        continue;
      }
      double expected = 0;
      if (o < out) {
        expected = bias[static_cast<std::size_t>(o)];
        for (int i = 0; i < in; ++i)
          expected += rounded(x[static_cast<std::size_t>(r * stride + i)]) *
                      rounded(weight[static_cast<std::size_t>(o * in + i)]);
      }
      ASSERT_NEAR(value, expected, 1e-6 * in) << r << " " << o;
    }
}

TEST_P(Bf16Gemm, OfARowDoNotDependOnTheRowsBesideIt) {
  const auto [rows, in, out] = std::get<1>(GetParam());
  const auto x = random_values(static_cast<std::size_t>(rows * in), 4),
             weight = random_values(static_cast<std::size_t>(out * in), 5);
  const Linear linear(out, in, weight.data(), in);
  const int width = linear.width();
  std::vector<float> all(static_cast<std::size_t>(rows * width)), one(static_cast<std::size_t>(width));
  linear.apply(x.data(), in, rows, all.data(), width);
  for (int r = 0; r < rows; ++r) {
    linear.apply(x.data() + r * in, in, 1, one.data(), width);
    for (int o = 0; o < width; ++o)
      ASSERT_EQ(one[static_cast<std::size_t>(o)], all[static_cast<std::size_t>(r * width + o)]);
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, Bf16Gemm,
                         ::testing::Combine(::testing::Values(Bf16Extension::vectors, Bf16Extension::matrices),
                                            ::testing::Values(std::tuple(1, 64, 32), std::tuple(15, 96, 33),
                                                              std::tuple(16, 128, 128), std::tuple(17, 128, 384),
                                                              std::tuple(32, 256, 128), std::tuple(70, 128, 3),
                                                              std::tuple(33, 512, 40))));

TEST(GemmPrecision, OtherInputsStayInF32) {
  if (!has_bf16_units()) GTEST_SKIP() << "this processor has no units for bf16";
  for (const int in : {31, 32, 43, 100}) {
    const auto x = random_values(static_cast<std::size_t>(in), 1),
               weight = random_values(static_cast<std::size_t>(32 * in), 2);
    const Linear linear(32, in, weight.data(), in);
    Buffer<float> exact(Device::cpu, 32), also(Device::cpu, 32);
    linear.apply(x.data(), in, 1, exact.data(), 32);
    set_bf16_gemm(true);
    linear.apply(x.data(), in, 1, also.data(), 32);
    set_bf16_gemm(false);
    EXPECT_TRUE(std::equal(exact.begin(), exact.end(), also.begin())) << in;
  }
}

TEST(GemmPrecision, FollowsTheEnvironment) {
  EXPECT_FALSE(uses_bf16_gemm()) << "libraries compute in f32 until a program asks for less";
  ::unsetenv("GRAUPEL_PRODUCTS");
  choose_gemm_precision();
  EXPECT_EQ(bf16_units_in_use(), fastest_bf16_units());
  ::setenv("GRAUPEL_PRODUCTS", "f32", 1);
  choose_gemm_precision();
  EXPECT_FALSE(uses_bf16_gemm());
  ::setenv("GRAUPEL_PRODUCTS", "bf16", 1);
  if (has_bf16_units()) {
    choose_gemm_precision();
    EXPECT_EQ(bf16_units_in_use(), available_bf16_units());
    ::setenv("GRAUPEL_PRODUCTS", "bf16-vectors", 1);
    choose_gemm_precision();
    EXPECT_EQ(bf16_units_in_use(), Bf16Extension::vectors);
    EXPECT_STREQ(gemm_precision_name(), "bf16 products on vector units");
  } else {
    EXPECT_THROW(choose_gemm_precision(), ConfigError);
  }
  ::setenv("GRAUPEL_PRODUCTS", "f16", 1);
  try {
    choose_gemm_precision();
    ADD_FAILURE() << "an unknown word was taken";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("'f16'"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("f32, bf16"), std::string::npos) << error.what();
  }
  ::unsetenv("GRAUPEL_PRODUCTS");
  set_bf16_gemm(false);
}

}  // namespace
}  // namespace graupel::nn
