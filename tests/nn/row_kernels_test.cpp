// The loops over rows, by every instruction set that this processor runs: those of the formulas.
#include "nn/row_kernels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/math/random.h"
#include "core/parallel/buffer.h"
#include "nn/weights.h"
#include "tests/exported_symbols.h"

namespace graupel::nn {
namespace {

using Row = Buffer<float>;

Row random_row(std::size_t n, uint64_t stream) {
  const Random random(1, RandomPurpose::test, stream);
  Row row(Device::cpu, n);
  for (std::size_t i = 0; i < n; ++i) row[i] = static_cast<float>(random.uniform(i, 0, -1, 1));
  return row;
}
Row copy_of(const Row& row) {
  Row copy(Device::cpu, row.size());
  std::copy(row.begin(), row.end(), copy.begin());
  return copy;
}
double leaky(double x, double slope = 0.01) { return x > 0 ? x : slope * x; }

/// Rounded to bf16; with the numbers that are left in `row`.
Buffer<uint32_t> packed(Row& row) {
  Buffer<uint32_t> words(Device::cpu, row.size() / 2);
  for (std::size_t i = 0; i < row.size(); ++i) {
    const uint32_t bits = bf16_from_float(row[i]);
    row[i] = float_from_bf16(static_cast<uint16_t>(bits));
    uint32_t& word = words[i / panel * (panel / 2) + i % (panel / 2)];
    word = i % panel < panel / 2 ? bits : word | bits << 16;
  }
  return words;
}

class RowKernels : public ::testing::TestWithParam<InstructionSet> {
 protected:
  const nn::RowKernels& kernels_ = row_kernels(GetParam());
};

TEST_P(RowKernels, Products) {
  constexpr std::size_t rows = 13, in = 37, stride = 41;
  const Row x = random_row(rows * stride, 1), weight = random_row(in * panel, 2), bias = random_row(panel, 3);
  Row y = random_row(rows * 2 * panel, 4);
  const Row before = copy_of(y);
  kernels_.multiply(x.data(), stride, rows, in, weight.data(), bias.data(), y.data(), 2 * panel);
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t c = 0; c < 2 * panel; ++c) {
      double sum = c >= panel ? before[r * 2 * panel + c] : bias[c];
      for (std::size_t k = 0; c < panel && k < in; ++k)
        sum += static_cast<double>(x[r * stride + k]) * weight[k * panel + c];
      ASSERT_NEAR(y[r * 2 * panel + c], sum, 1e-5) << r << " " << c;
    }
}

TEST_P(RowKernels, SumsOfActivations) {
  for (const int width : {32, 96, 128, 160}) {
    const auto w = static_cast<std::size_t>(width);
    Row rows = random_row(5 * w, 1), base = random_row(w, 3);
    const Row table = random_row(5 * w, 2), exact_base = copy_of(base);
    const Buffer<uint32_t> packed_rows = packed(rows), packed_base = packed(base);
    const float weight[] = {1, 0.25f, -0.5f, 2, 0.125f};
    std::vector<ActivatedRow<float>> items;
    std::vector<ActivatedRow<uint32_t>> packed_items;
    for (int i = 0; i < 5; ++i) {
      items.push_back({rows.data() + i * width, table.data() + i * width, weight[i]});
      packed_items.push_back({packed_rows.data() + i * width / 2, table.data() + i * width, weight[i]});
    }
    Row onto = random_row(w, 4), over(Device::cpu, w), packed_over(Device::cpu, w), over_packed(Device::cpu, w);
    const Row start = copy_of(onto);
    Row packed_onto = copy_of(onto);
    kernels_.add_activated(width, 2, items.data(), onto.data());
    kernels_.add_activated(width, 3, items.data() + 2, onto.data());
    kernels_.add_activated_packed(width, 5, packed_items.data(), packed_onto.data());
    kernels_.sum_activated(width, 5, items.data(), exact_base.data(), over.data());
    kernels_.sum_activated_packed(width, 5, packed_items.data(), exact_base.data(), packed_over.data());
    kernels_.sum_activated_over_packed(width, 5, packed_items.data(), packed_base.data(), over_packed.data());
    for (std::size_t c = 0; c < w; ++c) {
      double alone = start[c], with_base = 0, with_packed = 0;
      for (std::size_t i = 0; i < 5; ++i) {
        const double x = static_cast<double>(rows[i * w + c]) + table[i * w + c];
        alone += weight[i] * leaky(x);
        with_base += weight[i] * leaky(x + exact_base[c]);
        with_packed += weight[i] * leaky(x + base[c]);
      }
      ASSERT_NEAR(onto[c], alone, 1e-5);
      ASSERT_EQ(packed_onto[c], onto[c]);
      ASSERT_NEAR(over[c], with_base, 1e-5);
      ASSERT_EQ(packed_over[c], over[c]);
      ASSERT_NEAR(over_packed[c], with_packed, 1e-5);
    }
  }
}

TEST_P(RowKernels, ColumnByColumn) {
  constexpr int width = 96;
  const Row a = random_row(width, 1), b = random_row(width, 2), c = random_row(width, 3), gamma = random_row(width, 4);
  const auto expect = [&](const Row& y, const auto& formula) {
    for (std::size_t i = 0; i < width; ++i) ASSERT_NEAR(y[i], formula(i), 2e-6) << i;
  };
  Row y = copy_of(a);
  kernels_.activate(y.data(), y.data(), nullptr, nullptr, width, 0);
  expect(y, [&](std::size_t i) { return leaky(a[i], 0); });
  kernels_.activate(y.data(), a.data(), b.data(), nullptr, width, 0.1f);
  expect(y, [&](std::size_t i) { return leaky(double{a[i]} + b[i], 0.1); });
  y = copy_of(c);
  kernels_.activate(y.data(), a.data(), b.data(), y.data(), width, 0.01f);
  expect(y, [&](std::size_t i) { return leaky(double{a[i]} + b[i] + c[i]); });
  y = copy_of(a);
  kernels_.add_scaled(y.data(), -0.3f, b.data(), width);
  expect(y, [&](std::size_t i) { return a[i] - 0.3 * b[i]; });
  y = copy_of(a);
  kernels_.add_three(y.data(), {0.5f, -2, 3}, {a.data(), b.data(), c.data()}, width);
  expect(y, [&](std::size_t i) { return 1.5 * a[i] - 2.0 * b[i] + 3.0 * c[i]; });
  double squares = 0;
  for (const float x : a) squares += double{x} * x;
  EXPECT_NEAR(kernels_.sum_of_squares(a.data(), width), squares, 1e-4);
  y = copy_of(a);
  kernels_.normalize(y.data(), 0.7f, y.data(), gamma.data(), b.data(), false, width);
  expect(y, [&](std::size_t i) { return 0.7 * a[i] * gamma[i] + b[i]; });
  y = copy_of(c);
  kernels_.normalize(y.data(), 0.7f, a.data(), gamma.data(), b.data(), true, width);
  expect(y, [&](std::size_t i) { return c[i] + 0.7 * a[i] * gamma[i] + b[i]; });
  y = copy_of(a);
  kernels_.scale_sum(y.data(), 0.7f, gamma.data(), 3, b.data(), nullptr, width);
  expect(y, [&](std::size_t i) { return 0.7 * gamma[i] * a[i] + 3.0 * b[i]; });
  y = copy_of(a);
  kernels_.scale_sum(y.data(), 0.7f, gamma.data(), 3, b.data(), c.data(), width);
  expect(y, [&](std::size_t i) { return c[i] + 0.7 * gamma[i] * a[i] + 3.0 * b[i]; });
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, RowKernels, ::testing::ValuesIn(available_instruction_sets()),
                         [](const auto& set) { return std::string(name_of(set.param)); });

TEST(RowKernelFiles, ExportTheirTableAlone) {
  expect_exports(GRAUPEL_NM, GRAUPEL_KERNEL_OBJECTS, "graupel::nn::[a-z0-9]+::kernels", 1);
}

}  // namespace
}  // namespace graupel::nn
