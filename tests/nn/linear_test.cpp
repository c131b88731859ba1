#include "nn/linear.h"

#include <gtest/gtest.h>

#include "core/math/random.h"

namespace graupel::nn {
namespace {

std::vector<float> random_values(std::size_t n, uint64_t stream) {
  const Random random(1, RandomPurpose::test, stream);
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<float>(random.uniform(i, 0, -1, 1));
  return values;
}

/// (x W^T + b)(r, o) in double precision.
double product(const std::vector<float>& x, const std::vector<float>& weight, const std::vector<float>& bias, int in,
               int r, int o) {
  double sum = bias[o];
  for (int i = 0; i < in; ++i) sum += static_cast<double>(x[r * in + i]) * weight[o * in + i];
  return sum;
}

class LinearShapes : public ::testing::TestWithParam<std::tuple<int, int, int>> {};

TEST_P(LinearShapes, EqualsADoublePrecisionProduct) {
  const auto [rows, in, out] = GetParam();
  const auto x = random_values(rows * in, 1), weight = random_values(out * in, 2), bias = random_values(out, 3);
  const Linear linear(out, in, weight.data(), in, bias);
  const int width = linear.width();
  Buffer<float> y(Device::cpu, rows * width);
  linear.apply(x.data(), in, rows, y.data(), width);
  for (int r = 0; r < rows; ++r)
    for (int o = 0; o < width; ++o)
      ASSERT_NEAR(y[r * width + o], o < out ? product(x, weight, bias, in, r, o) : 0.0, 1e-6 * in) << r << " " << o;
}

INSTANTIATE_TEST_SUITE_P(Sizes, LinearShapes,
                         ::testing::Values(std::tuple(1, 1, 1), std::tuple(7, 3, 5), std::tuple(8, 32, 32),
                                           std::tuple(13, 40, 33), std::tuple(96, 128, 128), std::tuple(31, 43, 128),
                                           std::tuple(5, 128, 3)));

TEST(Linear, ARowDoesNotDependOnTheRowsBesideIt) {
  const int rows = 23, in = 37, out = 64;
  const auto x = random_values(rows * in, 4), weight = random_values(out * in, 5);
  const Linear linear(out, in, weight.data(), in);
  Buffer<float> all(Device::cpu, rows * out), one(Device::cpu, out);
  linear.apply(x.data(), in, rows, all.data(), out);
  for (int r = 0; r < rows; ++r) {
    linear.apply(x.data() + r * in, in, 1, one.data(), out);
    for (int o = 0; o < out; ++o) ASSERT_EQ(one[o], all[r * out + o]);
  }
}

TEST(Linear, TakesColumnsOfAWiderMatrixAndStridedRows) {
  const int in = 6, out = 2;
  const auto weight = random_values(out * in, 6), x = random_values(2 * in, 7);
  const Linear linear(out, 2, weight.data() + 3, in);  // columns 3 and 4
  Buffer<float> y(Device::cpu, 2 * 64);
  y.fill_zero();
  linear.apply(x.data() + 1, in, 2, y.data(), 64);
  for (int r = 0; r < 2; ++r)
    for (int o = 0; o < out; ++o)
      EXPECT_NEAR(y[r * 64 + o], x[r * in + 1] * weight[o * in + 3] + x[r * in + 2] * weight[o * in + 4], 1e-6);
}

}  // namespace
}  // namespace graupel::nn
