// Layers of the reference networks, in double precision.
#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "nn/weights.h"

namespace graupel::graph {

using Row = std::vector<double>;
using Rows = std::vector<Row>;

inline Row join(std::initializer_list<Row> parts) {
  Row all;
  for (const Row& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

inline void add(Row& sum, const Row& x, double factor = 1) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += factor * x[i];
}

class ReferenceLayers {
 public:
  ReferenceLayers(const nn::Weights& weights, int64_t hidden_layers, double slope)
      : hidden_layers_(hidden_layers), slope_(slope) {
    for (const auto& [name, tensor] : weights.tensors)
      for (const float v : tensor.as_float()) values_[name].push_back(v);
  }

  Row linear(const std::string& name, const Row& x) const {
    const Row& weight = values_.at(name + ".weight");
    Row y = values_.at(name + ".bias");
    for (std::size_t o = 0; o < y.size(); ++o)
      for (std::size_t i = 0; i < x.size(); ++i) y[o] += weight[o * x.size() + i] * x[i];
    return y;
  }
  /// a(linear(x)).
  Row activated(const std::string& name, const Row& x) const {
    Row y = linear(name, x);
    for (double& v : y) v = v > 0 ? v : slope_ * v;
    return y;
  }
  /// With its layer norm, where it has one.
  Row fcn(const std::string& name, Row x) const {
    for (int64_t l = 1; l <= hidden_layers_; ++l) x = activated(name + ".layer" + std::to_string(l), x);
    Row y = linear(name + ".layer" + std::to_string(hidden_layers_ + 1), x);
    if (!values_.count(name + ".norm.weight")) return y;
    const auto n = static_cast<double>(y.size());
    double mean = 0, variance = 0;
    for (const double v : y) mean += v / n;
    for (const double v : y) variance += (v - mean) * (v - mean) / n;
    const Row &gamma = values_.at(name + ".norm.weight"), &beta = values_.at(name + ".norm.bias");
    for (std::size_t i = 0; i < y.size(); ++i) y[i] = (y[i] - mean) / std::sqrt(variance + 1e-5) * gamma[i] + beta[i];
    return y;
  }

  /// Latents of all particles: FCN([features, embedding of the type]).
  Rows encode(const std::string& name, const std::vector<float>& features, const std::vector<int32_t>& type) const {
    const Row& table = values_.at("embedding.weight");
    const std::size_t width = table.size() / 9, own = features.size() / type.size();
    Rows latent;
    for (std::size_t p = 0; p < type.size(); ++p) {
      Row input;
      for (std::size_t i = 0; i < own; ++i) input.push_back(features[p * own + i]);
      for (std::size_t i = 0; i < width; ++i) input.push_back(table[static_cast<std::size_t>(type[p]) * width + i]);
      latent.push_back(fcn(name, input));
    }
    return latent;
  }
  std::vector<double> decode(const Rows& latent) const {
    std::vector<double> acceleration;
    for (const Row& row : latent)
      for (const double a : fcn("decoder", row)) acceleration.push_back(a);
    return acceleration;
  }

 private:
  int64_t hidden_layers_;
  double slope_;
  std::map<std::string, Row> values_;
};

}  // namespace graupel::graph
