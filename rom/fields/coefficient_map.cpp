#include "rom/fields/coefficient_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

constexpr double box_margin = 0.1;  ///< of the data's extent

nn::Tensor tensor_of(const std::vector<double>& values, std::vector<int64_t> shape) {
  return nn::Tensor::from_float({values.begin(), values.end()}, std::move(shape));
}

}  // namespace

CoefficientMap::CoefficientMap(int inputs, int outputs, std::vector<double> shift, std::vector<double> scale,
                               const std::vector<double>& centers, const std::vector<double>& weights,
                               const std::vector<double>& linear)
    : inputs_(inputs),
      outputs_(outputs),
      count_(static_cast<int>(centers.size()) / inputs),
      shift_(std::move(shift)),
      scale_(std::move(scale)),
      centers_(count_, inputs),
      weights_(Eigen::Map<const Eigen::MatrixXd>(weights.data(), outputs, count_)),
      linear_(Eigen::Map<const Eigen::MatrixXd>(linear.data(), outputs, 1 + inputs)) {
  const auto n = static_cast<std::size_t>(inputs_);
  GRAUPEL_ASSERT(shift_.size() == n && scale_.size() == n);
  GRAUPEL_ASSERT(weights.size() == static_cast<std::size_t>(count_) * static_cast<std::size_t>(outputs_));
  GRAUPEL_ASSERT(linear.size() == (n + 1) * static_cast<std::size_t>(outputs_));
  for (std::size_t j = 0; j < n; ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    for (Eigen::Index i = 0; i < count_; ++i)
      centers_(i, column) = (centers[static_cast<std::size_t>(i) * n + j] - shift_[j]) * scale_[j];
    const double low = count_ > 0 ? centers_.col(column).minCoeff() : 0,
                 high = count_ > 0 ? centers_.col(column).maxCoeff() : 0, margin = box_margin * (high - low);
    low_.push_back(low - margin);
    high_.push_back(high + margin);
  }
}

CoefficientMap::Place CoefficientMap::place(const double* z) const {
  const auto n = static_cast<std::size_t>(inputs_);
  Place p{Eigen::VectorXd(inputs_), Eigen::VectorXd(inputs_), std::vector<bool>(n)};
  for (std::size_t j = 0; j < n; ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    p.y[at] = (z[j] - shift_[j]) * scale_[j];
    p.inside[at] = count_ > 0 ? std::clamp(p.y[at], low_[j], high_[j]) : p.y[at];
    p.clamped[j] = p.inside[at] != p.y[at];
  }
  return p;
}

Eigen::ArrayXd CoefficientMap::squared_distances(const Eigen::VectorXd& y) const {
  Eigen::ArrayXd r2 = Eigen::ArrayXd::Zero(count_);
  for (Eigen::Index j = 0; j < inputs_; ++j) r2 += (centers_.col(j) - y[j]).square();
  return r2;
}

void CoefficientMap::evaluate(const double* z, double* c) const {
  const Place p = place(z);
  const Eigen::ArrayXd r2 = squared_distances(p.inside);
  Eigen::Map<Eigen::VectorXd> to(c, outputs_);
  to.noalias() = linear_.col(0) + linear_.rightCols(inputs_) * p.y;
  to.noalias() += weights_ * (r2 * r2.sqrt()).matrix();
}

void CoefficientMap::derivative(const double* z, int wrt, double* jacobian) const {
  const Place p = place(z);
  // d|d|^3 / dd = 3 |d| d.
  const Eigen::ArrayXd slope = 3 * squared_distances(p.inside).sqrt();
  Eigen::MatrixXd radial(count_, wrt);
  for (Eigen::Index j = 0; j < wrt; ++j) {
    if (p.clamped[static_cast<std::size_t>(j)])
      radial.col(j).setZero();
    else
      radial.col(j) = slope * (p.inside[j] - centers_.col(j));
  }
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<RowMajor> to(jacobian, outputs_, wrt);
  to.noalias() = linear_.middleCols(1, wrt) + weights_ * radial;
  for (Eigen::Index j = 0; j < wrt; ++j) to.col(j) *= scale_[static_cast<std::size_t>(j)];
}

CoefficientMap::Parts CoefficientMap::parts() const {
  Parts parts{count_, shift_, scale_, low_, high_, {}, {}, {}};
  for (Eigen::Index j = 0; j < inputs_; ++j)
    for (Eigen::Index i = 0; i < count_; ++i) parts.centers.push_back(centers_(i, j));
  for (Eigen::Index k = 0; k < outputs_; ++k) {
    for (Eigen::Index i = 0; i < count_; ++i) parts.weights.push_back(weights_(k, i));
    for (Eigen::Index j = 0; j <= inputs_; ++j) parts.linear.push_back(linear_(k, j));
  }
  return parts;
}

CoefficientMap CoefficientMap::load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs) {
  const auto get = [&](const char* name, const std::vector<int64_t>& shape) {
    const std::vector<float> values = weights.get(prefix + name, shape);
    return std::vector<double>(values.begin(), values.end());
  };
  const auto centers = weights.tensors.find(prefix + ".centers");
  const int64_t count =
      centers == weights.tensors.end() || centers->second.shape.empty() ? 0 : centers->second.shape[0];
  return {inputs,
          outputs,
          get(".shift", {inputs}),
          get(".scale", {inputs}),
          get(".centers", {count, inputs}),
          get(".weights", {count, outputs}),
          get(".linear", {1 + inputs, outputs})};
}

void CoefficientMap::store(nn::Weights& weights, const std::string& prefix) const {
  std::vector<double> centers;
  for (Eigen::Index i = 0; i < count_; ++i)
    for (Eigen::Index j = 0; j < inputs_; ++j)
      centers.push_back(centers_(i, j) / scale_[static_cast<std::size_t>(j)] + shift_[static_cast<std::size_t>(j)]);
  const auto values = [](const Eigen::MatrixXd& m) { return std::vector<double>(m.data(), m.data() + m.size()); };
  weights.tensors[prefix + ".shift"] = tensor_of(shift_, {inputs_});
  weights.tensors[prefix + ".scale"] = tensor_of(scale_, {inputs_});
  weights.tensors[prefix + ".centers"] = tensor_of(centers, {count_, inputs_});
  weights.tensors[prefix + ".weights"] = tensor_of(values(weights_), {count_, outputs_});
  weights.tensors[prefix + ".linear"] = tensor_of(values(linear_), {1 + inputs_, outputs_});
}

}  // namespace graupel::rom
