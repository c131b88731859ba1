#include "nn/fcn.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::nn {
namespace {

constexpr int in = 11, hidden = 40, out = 24;

Weights random_fcn() {
  const Random random(3, RandomPurpose::test);
  Weights weights;
  weights.file = "made.safetensors";
  uint64_t draw = 0;
  const auto add = [&](const std::string& name, std::vector<int64_t> shape) {
    Tensor tensor{.dtype = DType::f32, .shape = shape, .bytes = {}};
    std::vector<float> values(static_cast<std::size_t>(tensor.count()));
    for (float& v : values) v = static_cast<float>(random.uniform(draw++, 0, -1, 1));
    weights.tensors[name] = Tensor::from_float(values, shape);
  };
  add("f.layer1.weight", {hidden, in});
  add("f.layer1.bias", {hidden});
  add("f.layer2.weight", {out, hidden});
  add("f.layer2.bias", {out});
  add("f.norm.weight", {out});
  add("f.norm.bias", {out});
  return weights;
}

/// The formula, in double precision.
std::vector<double> reference(const FcnWeights& f, const std::vector<float>& x) {
  std::vector<double> h(hidden), y(out);
  for (int o = 0; o < hidden; ++o) {
    double sum = f.bias1[o];
    for (int i = 0; i < in; ++i) sum += static_cast<double>(f.weight1[o * in + i]) * x[i];
    h[o] = sum > 0 ? sum : 0.01 * sum;
  }
  double mean = 0, variance = 0;
  for (int o = 0; o < out; ++o) {
    y[o] = f.bias2[o];
    for (int i = 0; i < hidden; ++i) y[o] += f.weight2[o * hidden + i] * h[i];
    mean += y[o] / out;
  }
  for (double v : y) variance += (v - mean) * (v - mean) / out;
  for (int o = 0; o < out; ++o) y[o] = (y[o] - mean) / std::sqrt(variance + 1e-5) * f.gamma[o] + f.beta[o];
  return y;
}

TEST(Fcn, SplitFirstLayerAndFoldedNormEqualTheFormula) {
  const FcnWeights f = FcnWeights::load(random_fcn(), "f", in, hidden, out);
  const int width = padded_width(hidden);
  const std::vector<float> x = {0.3f, -1.2f, 0.7f, 2.0f, -0.1f, 0.9f, -0.4f, 1.1f, 0.5f, -1.0f, 1.0f};
  // columns 0..4 and 5..7 as parts, 8..10 as a table row
  const Linear first = f.first_layer_part(0, 5, FcnWeights::Bias::with);
  const Linear second = f.first_layer_part(5, 3, FcnWeights::Bias::without);
  const InputTable table(f, 8, {{0, 0, 1}, {0.5f, -1.0f, 1.0f}});
  Buffer<float> h(Device::cpu, width), part(Device::cpu, width), y(Device::cpu, padded_width(out));
  first.apply(x.data(), 5, 1, h.data(), width);
  second.apply(x.data() + 5, 3, 1, part.data(), width);
  add_scaled_row(h.data(), 1, part.data(), width);
  add_scaled_row(h.data(), 1, table.row(1), width);
  activate_row(h.data(), width);
  const NormalizedLayer layer(f);
  layer.apply(h.data(), 1, y.data());
  const float scale = layer.scale(y.data());
  const auto expected = reference(f, x);
  for (int o = 0; o < out; ++o) EXPECT_NEAR(scale * y[o] * layer.gamma()[o] + layer.beta()[o], expected[o], 2e-5);
  for (int o = out; o < layer.width(); ++o) EXPECT_EQ(y[o], 0);
}

TEST(Fcn, StackedMapsEqualTheirParts) {
  const FcnWeights f = FcnWeights::load(random_fcn(), "f", in, hidden, out);
  const int width = padded_width(hidden);
  const StackedLinear stacked(4, {{&f, 0, FcnWeights::Bias::without}, {&f, 6, FcnWeights::Bias::with}});
  ASSERT_EQ(stacked.width(), 2 * width);
  const std::vector<float> x = {1, -2, 3, 0.5f};
  Buffer<float> both(Device::cpu, 2 * width), one(Device::cpu, width);
  stacked.linear().apply(x.data(), 4, 1, both.data(), 2 * width);
  f.first_layer_part(0, 4, FcnWeights::Bias::without).apply(x.data(), 4, 1, one.data(), width);
  for (int o = 0; o < width; ++o) EXPECT_EQ(both[o], one[o]);
  f.first_layer_part(6, 4, FcnWeights::Bias::with).apply(x.data(), 4, 1, one.data(), width);
  for (int o = 0; o < width; ++o) EXPECT_EQ(both[width + o], one[o]);
}

TEST(Fcn, LayerNormHasZeroMeanAndUnitVariance) {
  FcnWeights f = FcnWeights::load(random_fcn(), "f", in, hidden, out);
  f.gamma.assign(out, 1.0f);
  f.beta.assign(out, 0.0f);
  for (float& b : f.bias2) b += 1000;  // a common shift is removed without loss of digits
  const NormalizedLayer layer(f);
  Buffer<float> h(Device::cpu, padded_width(hidden)), y(Device::cpu, layer.width());
  for (int i = 0; i < padded_width(hidden); ++i) h[i] = i < hidden ? std::sin(static_cast<float>(i)) : 0;
  layer.apply(h.data(), 1, y.data());
  const float scale = layer.scale(y.data());
  double mean = 0, square = 0;
  for (int o = 0; o < out; ++o) {
    mean += scale * y[o] / out;
    square += scale * y[o] * scale * y[o] / out;
  }
  EXPECT_NEAR(mean, 0, 1e-5);
  EXPECT_NEAR(square, 1, 1e-4);
}

TEST(Fcn, MissingTensorWrongShapeAndNaNAreInputErrors) {
  const auto message = [](const Weights& weights) -> std::string {
    try {
      FcnWeights::load(weights, "f", in, hidden, out);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message(random_fcn()), "");
  Weights weights = random_fcn();
  weights.tensors.erase("f.norm.bias");
  EXPECT_NE(message(weights).find("'f.norm.bias' is missing"), std::string::npos);
  weights = random_fcn();
  weights.tensors["f.layer2.weight"].shape = {hidden, out};
  EXPECT_NE(message(weights).find("[40, 24], needed [24, 40]"), std::string::npos);
  weights = random_fcn();
  std::vector<float> bias(hidden, 0.0f);
  bias[7] = std::nanf("");
  weights.tensors["f.layer1.bias"] = Tensor::from_float(bias, {hidden});
  EXPECT_NE(message(weights).find("element 7"), std::string::npos);
  weights = random_fcn();
  weights.tensors["f.layer1.bias"] = {
      .dtype = DType::i32, .shape = {hidden}, .bytes = std::vector<std::byte>(4 * hidden)};
  EXPECT_NE(message(weights).find("integers"), std::string::npos);
  EXPECT_NE(message(weights).find("made.safetensors"), std::string::npos);
}

TEST(Activation, LeakyReluAndLayerNormScale) {
  EXPECT_EQ(leaky_relu(2.0), 2.0);
  EXPECT_FLOAT_EQ(leaky_relu(-2.0f), -0.02f);
  const double scale = layer_norm_scale(4.0);
  EXPECT_NEAR(scale, 1 / std::sqrt(4.00001), 1e-9);
}

}  // namespace
}  // namespace graupel::nn
