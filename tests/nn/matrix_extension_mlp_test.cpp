// Rows that go through a network from end to end are what its layers make of them one after the other.
#include "nn/matrix_extension_mlp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "core/math/random.h"
#include "nn/bf16_gemm.h"
#include "nn/fcn.h"

namespace graupel::nn {
namespace {

Buffer<float> random_buffer(std::size_t n, uint64_t stream) {
  const Random random(2, RandomPurpose::test, stream);
  Buffer<float> values(Device::cpu, n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<float>(random.uniform(i, 0, -1, 1));
  return values;
}
std::vector<float> random_values(std::size_t n, uint64_t stream) {
  const Buffer<float> buffer = random_buffer(n, stream);
  return {buffer.begin(), buffer.end()};
}
Linear random_linear(int out, int in, uint64_t stream) {
  return Linear(out, in, random_values(static_cast<std::size_t>(out * in), stream).data(), in,
                random_values(static_cast<std::size_t>(out), stream + 1));
}
NormalizedLayer random_layer(int width) {
  const auto n = static_cast<std::size_t>(width);
  FcnWeights fcn;
  fcn.hidden = fcn.out = width;
  fcn.weight2 = random_values(n * n, 11);
  fcn.bias2 = random_values(n, 12);
  fcn.gamma = random_values(n, 13);
  fcn.beta = random_values(n, 14);
  return NormalizedLayer(fcn);
}

/// Column c of a packed row.
float unpacked(const uint32_t* row, int c) {
  const uint32_t word = row[c / panel * (panel / 2) + c % (panel / 2)];
  return float_from_bf16(static_cast<uint16_t>(c % panel < panel / 2 ? word : word >> 16));
}

enum class Form { on_sum, on_sum_and_latent, on_hidden };

class ChainOnUnits : public ::testing::TestWithParam<std::tuple<int, int, Form, Bf16Extension>> {
 protected:
  void SetUp() override {
    const Bf16Extension units = std::get<3>(GetParam());
    if (available_bf16_units() < units) GTEST_SKIP() << "this processor has no such units for bf16";
    use_bf16_units(units);
  }
  void TearDown() override { set_bf16_gemm(false); }
};

TEST_P(ChainOnUnits, IsItsLayersOneAfterTheOther) {
  const auto [rows, width, form, units] = GetParam();
  const bool on_hidden = form == Form::on_hidden, with_latent = form == Form::on_sum_and_latent;
  const auto count = static_cast<std::size_t>(rows * width);
  const Linear first = random_linear(width, with_latent ? 2 * width : width, 1);
  const NormalizedLayer second = random_layer(width);
  const Linear next = random_linear(2 * width, width, 3);
  const Buffer<float> input = random_buffer(count, 5);
  Buffer<float> latent = random_buffer(count, 6), expected = random_buffer(count, 6);

  Buffer<float> both(Device::cpu, 2 * count), hidden(Device::cpu, count), y(Device::cpu, count);
  for (int r = 0; r < rows; ++r) {
    std::copy_n(input.data() + r * width, width, both.data() + 2 * r * width);
    std::copy_n(latent.data() + r * width, width, both.data() + (2 * r + 1) * width);
  }
  if (on_hidden)
    std::copy_n(input.data(), count, hidden.data());
  else
    first.apply(with_latent ? both.data() : input.data(), with_latent ? 2 * width : width, rows, hidden.data(), width);
  for (int r = 0; r < rows && !on_hidden; ++r) activate_row(hidden.data() + r * width, width);
  second.apply(hidden.data(), rows, y.data());
  for (int r = 0; r < rows; ++r)
    with_latent ? second.add_to(expected.data() + r * width, y.data() + r * width)
                : second.finish(expected.data() + r * width, y.data() + r * width);

  const MatrixExtensionMlp chain{.first = on_hidden ? MatrixExtensionLayer() : first.on_units(),
                                 .second = second.linear().on_units(),
                                 .next = next.on_units(),
                                 .gamma = second.gamma(),
                                 .beta = second.beta(),
                                 .out = width};
  ASSERT_NE(chain.next.tiles, nullptr);
  Buffer<float> floats(Device::cpu, 2 * count);
  Buffer<uint32_t> packed(Device::cpu, count);
  ChainRows at{.rows = rows,
               .input = input.data(),
               .input_stride = width,
               .latent = latent.data(),
               .with_latent = with_latent,
               .add = with_latent,
               .next = floats.data()};
  apply_chain_on_units(chain, at);
  for (std::size_t i = 0; i < count; ++i) ASSERT_NEAR(latent[i], expected[i], 2e-5) << i;

  Buffer<float> projected(Device::cpu, 2 * count);
  next.apply(latent.data(), width, rows, projected.data(), 2 * width);
  for (std::size_t i = 0; i < 2 * count; ++i) ASSERT_NEAR(floats[i], projected[i], 1e-5 * width) << i;

  const Buffer<float> again = random_buffer(count, 6);
  std::copy_n(again.data(), count, latent.data());
  at.packed_next = packed.data();
  apply_chain_on_units(chain, at);
  Buffer<uint32_t> packed_rows(Device::cpu, count);
  pack_rows(floats.data(), rows, 2 * width, packed_rows.data());
  EXPECT_TRUE(std::equal(packed.begin(), packed.end(), packed_rows.begin()));
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < 2 * width; ++c) {
      const float value = floats[static_cast<std::size_t>(r * 2 * width + c)];
      ASSERT_EQ(unpacked(packed.data() + r * width, c), float_from_bf16(bf16_from_float(value))) << r << " " << c;
    }
}

INSTANTIATE_TEST_SUITE_P(Sizes, ChainOnUnits,
                         ::testing::Combine(::testing::Values(1, 16, 17, 32, 33, 70), ::testing::Values(64, 128, 160),
                                            ::testing::Values(Form::on_sum, Form::on_sum_and_latent, Form::on_hidden),
                                            ::testing::Values(Bf16Extension::vectors, Bf16Extension::matrices)));

}  // namespace
}  // namespace graupel::nn
