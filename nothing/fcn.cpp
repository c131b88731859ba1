#include "nn/fcn.h"

#include <algorithm>
#include <utility>

#include "core/system/error.h"

namespace graupel::nn {

namespace {

Buffer<float> padded(const std::vector<float>& values) {
  Buffer<float> buffer(Device::cpu, static_cast<std::size_t>(padded_width(static_cast<int>(values.size()))));
  buffer.fill_zero();
  std::copy(values.begin(), values.end(), buffer.begin());
  return buffer;
}

}  // namespace

FcnWeights FcnWeights::load(const Weights& weights, const std::string& prefix, int in, int hidden, int out, Norm norm,
                            int hidden_layers) {
  FcnWeights fcn;
  fcn.in = in;
  fcn.hidden = hidden_layers > 0 ? hidden : out;
  fcn.out = out;
  if (hidden_layers == 0) {
    fcn.weight1 = weights.get(prefix + ".weight", {out, in});
    fcn.bias1 = weights.get(prefix + ".bias", {out});
    return fcn;
  }
  fcn.weight1 = weights.get(prefix + ".layer1.weight", {hidden, in});
  fcn.bias1 = weights.get(prefix + ".layer1.bias", {hidden});
  for (int l = 2; l <= hidden_layers; ++l) {
    const std::string layer = prefix + ".layer" + std::to_string(l);
    fcn.middle.push_back({weights.get(layer + ".weight", {hidden, hidden}), weights.get(layer + ".bias", {hidden})});
  }
  const std::string last = prefix + ".layer" + std::to_string(hidden_layers + 1);
  fcn.weight2 = weights.get(last + ".weight", {out, hidden});
  fcn.bias2 = weights.get(last + ".bias", {out});
  if (norm == Norm::layer) {
    fcn.gamma = weights.get(prefix + ".norm.weight", {out});
    fcn.beta = weights.get(prefix + ".norm.bias", {out});
  }
  return fcn;
}

Linear FcnWeights::first_layer_of_padded(int parts) const {
  GRAUPEL_ASSERT(in % parts == 0);
  const int part = in / parts, padded_part = padded_width(part), padded_in = parts * padded_part;
  std::vector<float> weight(static_cast<std::size_t>(hidden) * static_cast<std::size_t>(padded_in), 0.0f);
  for (int o = 0; o < hidden; ++o)
    for (int p = 0; p < parts; ++p)
      std::copy_n(weight1.data() + static_cast<int64_t>(o) * in + p * part, part,
                  weight.data() + static_cast<int64_t>(o) * padded_in + p * padded_part);
  return Linear(hidden, padded_in, weight.data(), padded_in, bias1);
}

Linear FcnWeights::first_layer_part(int column, int count, Bias bias) const {
  GRAUPEL_ASSERT(column >= 0 && count > 0 && column + count <= in);
  return Linear(hidden, count, weight1.data() + column, in, bias == Bias::with ? bias1 : std::vector<float>());
}

StackedLinear::StackedLinear(int in, const std::vector<Part>& parts) {
  std::vector<float> weight, bias;
  for (const Part& part : parts) {
    const FcnWeights& fcn = *part.fcn;
    GRAUPEL_ASSERT(part.column >= 0 && part.column + in <= fcn.in);
    const auto row = weight.size() / static_cast<std::size_t>(in);
    weight.resize((row + padded_width(fcn.hidden)) * in, 0.0f);
    bias.resize(row + padded_width(fcn.hidden), 0.0f);
    for (int o = 0; o < fcn.hidden; ++o)
      std::copy_n(fcn.weight1.data() + static_cast<int64_t>(o) * fcn.in + part.column, in,
                  weight.data() + (row + o) * in);
    if (part.bias == FcnWeights::Bias::with) std::copy(fcn.bias1.begin(), fcn.bias1.end(), bias.begin() + row);
  }
  linear_ = Linear(static_cast<int>(bias.size()), in, weight.data(), in, bias);
}

InputTable::InputTable(const FcnWeights& fcn, int column, const std::vector<std::vector<float>>& values)
    : width_(padded_width(fcn.hidden)), rows_(Device::cpu, values.size() * static_cast<std::size_t>(width_)) {
  rows_.fill_zero();
  for (std::size_t i = 0; i < values.size(); ++i)
    for (int o = 0; o < fcn.hidden; ++o) {
      double sum = 0;
      for (std::size_t a = 0; a < values[i].size(); ++a)
        sum += static_cast<double>(values[i][a]) * fcn.weight1[static_cast<std::size_t>(o) * fcn.in + column + a];
      rows_[i * width_ + o] = static_cast<float>(sum);
    }
}

MiddleLayers::MiddleLayers(const FcnWeights& fcn, float slope) : slope_(slope) {
  for (const FcnWeights::Layer& layer : fcn.middle)
    layers_.emplace_back(fcn.hidden, fcn.hidden, layer.weight.data(), fcn.hidden, layer.bias);
}

float* MiddleLayers::apply(float* hidden, float* spare, int64_t rows) const {
  for (const Linear& layer : layers_) {
    const int width = layer.width();
    layer.apply(hidden, width, rows, spare, width);
    for (int64_t r = 0; r < rows; ++r) activate_row(spare + r * width, width, slope_);
    std::swap(hidden, spare);
  }
  return hidden;
}

NormalizedLayer::NormalizedLayer(const FcnWeights& fcn)
    : width_in_(padded_width(fcn.hidden)), gamma_(padded(fcn.gamma)), beta_(padded(fcn.beta)) {
  GRAUPEL_ASSERT(static_cast<int>(fcn.gamma.size()) == fcn.out);
  const auto out = static_cast<std::size_t>(fcn.out), hidden = static_cast<std::size_t>(fcn.hidden);
  std::vector<float> weight = fcn.weight2, bias = fcn.bias2;
  for (std::size_t i = 0; i <= hidden; ++i) {  // column `hidden` is the bias
    const auto entry = [&](std::size_t o) -> float& { return i < hidden ? weight[o * hidden + i] : bias[o]; };
    double mean = 0;
    for (std::size_t o = 0; o < out; ++o) mean += entry(o);
    mean /= static_cast<double>(out);
    for (std::size_t o = 0; o < out; ++o) entry(o) = static_cast<float>(entry(o) - mean);
  }
  linear_ = Linear(fcn.out, fcn.hidden, weight.data(), fcn.hidden, bias);
}

}  // namespace graupel::nn
