#include "rom/networks/mlp.h"

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "rom/networks/tensors.h"

namespace graupel::rom {

namespace {

std::string layer_name(const std::string& prefix, int layer) { return prefix + ".layer" + std::to_string(layer); }

Eigen::Map<const Eigen::RowVectorXd> row_of(const std::vector<double>& values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

}  // namespace

MlpLayer load_layer(const nn::Weights& weights, const std::string& name, const std::vector<int64_t>& shape) {
  MlpLayer layer;
  layer.out = static_cast<int>(shape[0]);
  layer.weight = weights.get(name + ".weight", shape);
  layer.in = 1;
  for (std::size_t axis = 1; axis < shape.size(); ++axis) layer.in *= static_cast<int>(shape[axis]);
  layer.bias = weights.get(name + ".bias", {layer.out});
  return layer;
}

void store_layer(nn::Weights& weights, const std::string& name, const MlpLayer& layer, std::vector<int64_t> shape) {
  weights.tensors[name + ".weight"] = nn::Tensor::from_float(layer.weight, std::move(shape));
  weights.tensors[name + ".bias"] = nn::Tensor::from_float(layer.bias, {layer.out});
}

Mlp::Mlp(std::vector<MlpLayer> layers, Standardization input, Standardization output)
    : layers_(std::move(layers)), input_(rounded(input)), output_(rounded(output)) {
  GRAUPEL_ASSERT(layers_.size() == static_cast<std::size_t>(layer_count));
  GRAUPEL_ASSERT(input_.shift.size() == static_cast<std::size_t>(inputs()) &&
                 input_.scale.size() == input_.shift.size());
  GRAUPEL_ASSERT(output_.shift.size() == static_cast<std::size_t>(outputs()) &&
                 output_.scale.size() == output_.shift.size());
  for (const MlpLayer& layer : layers_) {
    GRAUPEL_ASSERT(layer.weight.size() == static_cast<std::size_t>(layer.in) * static_cast<std::size_t>(layer.out));
    using Single = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    weight_.push_back(Eigen::Map<const Single>(layer.weight.data(), layer.out, layer.in).cast<double>());
    bias_.push_back(Eigen::Map<const Eigen::RowVectorXf>(layer.bias.data(), layer.out).cast<double>());
  }
}

void Mlp::forward(const Rows& z, Rows& y, std::vector<Rows>* slope) const {
  Rows h = (z.rowwise() - row_of(input_.shift)).array().rowwise() * row_of(input_.scale).array();
  for (int l = 0; l < hidden_layers; ++l) {
    const auto i = static_cast<std::size_t>(l);
    Rows a = h * weight_[i].transpose();
    h = (a.rowwise() + bias_[i]).unaryExpr([](double x) { return x > 0 ? x : std::expm1(x); });
    if (slope) slope->push_back(h.unaryExpr([](double e) { return e > 0 ? 1.0 : e + 1.0; }));
  }
  y = h * weight_.back().transpose();
  y.rowwise() += bias_.back();
  y = (y.array().rowwise() * row_of(output_.scale).array()).rowwise() + row_of(output_.shift).array();
}

void Mlp::evaluate(const Rows& z, Rows& y) const { forward(z, y, nullptr); }

void Mlp::evaluate(const Rows& z, Rows& y, Rows& jacobian) const {
  const Eigen::Index n = z.rows(), d = outputs();
  std::vector<Rows> slope;
  forward(z, y, &slope);
  Rows back(n * d, width());  // d output c of row r / d hidden units
  const auto times_slope = [&](const Rows& s) {
    for (Eigen::Index r = 0; r < n; ++r) back.middleRows(r * d, d).array().rowwise() *= s.row(r).array();
  };
  for (Eigen::Index r = 0; r < n; ++r)
    back.middleRows(r * d, d) = row_of(output_.scale).transpose().asDiagonal() * weight_.back();
  for (int l = hidden_layers - 1; l > 0; --l) {
    times_slope(slope[static_cast<std::size_t>(l)]);
    back = (back * weight_[static_cast<std::size_t>(l)]).eval();
  }
  times_slope(slope[0]);
  jacobian = (back * weight_[0]).array().rowwise() * row_of(input_.scale).array();
}

void Mlp::tangents(const Rows& z, int wrt, Rows& y, Rows& slopes) const {
  Rows h = Rows::Zero(1 + wrt, inputs());  // the values, then their derivatives
  h.row(0) = (z.row(0) - row_of(input_.shift)).array() * row_of(input_.scale).array();
  for (int j = 0; j < wrt; ++j) h(1 + j, j) = input_.scale[static_cast<std::size_t>(j)];
  for (int l = 0; l < layer_count; ++l) {
    const auto i = static_cast<std::size_t>(l);
    h = (h * weight_[i].transpose()).eval();
    h.row(0) += bias_[i];
    if (l == hidden_layers) break;
    h.row(0) = h.row(0).unaryExpr([](double x) { return x > 0 ? x : std::expm1(x); }).eval();
    const Eigen::RowVectorXd slope = h.row(0).unaryExpr([](double e) { return e > 0 ? 1.0 : e + 1.0; });
    h.bottomRows(wrt).array().rowwise() *= slope.array();
  }
  h.array().rowwise() *= row_of(output_.scale).array();
  y = h.row(0) + row_of(output_.shift);
  slopes = h.bottomRows(wrt);
}

int mlp_inputs(const nn::Weights& weights, const std::string& prefix) {
  return static_cast<int>(extent(weights, layer_name(prefix, 0) + ".weight", 1));
}

Mlp Mlp::load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs) {
  const auto width = static_cast<int>(extent(weights, layer_name(prefix, 0) + ".weight", 0));
  if (width < 1 || width > 65536)
    throw InputError("'" + weights.file + "': the network '" + prefix + "' has " + std::to_string(width) +
                     " hidden units (allowed: 1 to 65536). Train the model again");
  return {load_layers(weights, prefix + ".", inputs, width, outputs),
          load_standardization(weights, prefix + ".input", inputs),
          load_standardization(weights, prefix + ".output", outputs)};
}

std::vector<MlpLayer> Mlp::load_layers(const nn::Weights& weights, const std::string& prefix, int inputs, int width,
                                       int outputs) {
  std::vector<MlpLayer> layers;
  layers.reserve(static_cast<std::size_t>(layer_count));
  for (int l = 0; l < layer_count; ++l)
    layers.push_back(load_layer(weights, prefix + "layer" + std::to_string(l),
                                {l == hidden_layers ? outputs : width, l == 0 ? inputs : width}));
  return layers;
}

void Mlp::store(nn::Weights& weights, const std::string& prefix) const {
  for (int l = 0; l < layer_count; ++l) {
    const MlpLayer& layer = layers_[static_cast<std::size_t>(l)];
    store_layer(weights, layer_name(prefix, l), layer, {layer.out, layer.in});
  }
  store_standardization(weights, prefix + ".input", input_);
  store_standardization(weights, prefix + ".output", output_);
}

}  // namespace graupel::rom
