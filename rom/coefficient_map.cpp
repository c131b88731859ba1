#include "rom/coefficient_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"

namespace graupel::rom {

namespace {

constexpr double box_margin = 0.1;  ///< of the data's extent

nn::Tensor tensor_of(const std::vector<double>& values, std::vector<int64_t> shape) {
  return nn::Tensor::from_float({values.begin(), values.end()}, std::move(shape));
}

}  // namespace

CoefficientMap::CoefficientMap(int inputs, int outputs, std::vector<double> shift, std::vector<double> scale,
                               std::vector<double> centers, std::vector<double> weights, std::vector<double> linear)
    : inputs_(inputs),
      outputs_(outputs),
      count_(static_cast<int>(centers.size()) / inputs),
      shift_(std::move(shift)),
      scale_(std::move(scale)),
      centers_(std::move(centers)),
      weights_(std::move(weights)),
      linear_(std::move(linear)),
      low_(static_cast<std::size_t>(inputs), INFINITY),
      high_(static_cast<std::size_t>(inputs), -INFINITY) {
  const auto n = static_cast<std::size_t>(inputs_);
  GRAUPEL_ASSERT(shift_.size() == n && scale_.size() == n);
  GRAUPEL_ASSERT(weights_.size() == static_cast<std::size_t>(count_) * static_cast<std::size_t>(outputs_));
  GRAUPEL_ASSERT(linear_.size() == (n + 1) * static_cast<std::size_t>(outputs_));
  for (std::size_t i = 0; i < centers_.size(); ++i) {
    const std::size_t j = i % n;
    centers_[i] = (centers_[i] - shift_[j]) * scale_[j];
    low_[j] = std::min(low_[j], centers_[i]);
    high_[j] = std::max(high_[j], centers_[i]);
  }
  for (std::size_t j = 0; j < n; ++j) {
    const double margin = box_margin * (high_[j] - low_[j]);
    low_[j] -= margin;
    high_[j] += margin;
  }
}

CoefficientMap::Place CoefficientMap::place(const double* z) const {
  const auto n = static_cast<std::size_t>(inputs_);
  Place p{std::vector<double>(n), std::vector<double>(n), std::vector<bool>(n)};
  for (std::size_t j = 0; j < n; ++j) {
    p.y[j] = (z[j] - shift_[j]) * scale_[j];
    p.inside[j] = count_ > 0 ? std::clamp(p.y[j], low_[j], high_[j]) : p.y[j];
    p.held[j] = p.inside[j] != p.y[j];
  }
  return p;
}

void CoefficientMap::evaluate(const double* z, double* c) const {
  const Place p = place(z);
  std::copy_n(linear_.begin(), outputs_, c);
  for (int j = 0; j < inputs_; ++j) {
    const double* row = linear_.data() + (1 + j) * outputs_;
    for (int k = 0; k < outputs_; ++k) c[k] += p.y[static_cast<std::size_t>(j)] * row[k];
  }
  for (int i = 0; i < count_; ++i) {
    double r2 = 0;
    for (int j = 0; j < inputs_; ++j) {
      const double d = p.inside[static_cast<std::size_t>(j)] - centers_[static_cast<std::size_t>(i * inputs_ + j)];
      r2 += d * d;
    }
    const double kernel = r2 * std::sqrt(r2);
    const double* w = weights_.data() + static_cast<std::ptrdiff_t>(i) * outputs_;
    for (int k = 0; k < outputs_; ++k) c[k] += kernel * w[k];
  }
}

void CoefficientMap::derivative(const double* z, int wrt, double* jacobian) const {
  const Place p = place(z);
  // d|d|^3 / dd = 3 |d| d; summed with the outputs in the inner loop, transposed at the end.
  std::vector<double> rows(static_cast<std::size_t>(wrt) * static_cast<std::size_t>(outputs_));
  for (int j = 0; j < wrt; ++j)
    for (int k = 0; k < outputs_; ++k)
      rows[static_cast<std::size_t>(j * outputs_ + k)] = linear_[static_cast<std::size_t>((1 + j) * outputs_ + k)];
  std::vector<double> d(static_cast<std::size_t>(inputs_));
  for (int i = 0; i < count_; ++i) {
    double r2 = 0;
    for (int j = 0; j < inputs_; ++j) {
      const auto at = static_cast<std::size_t>(j);
      d[at] = p.inside[at] - centers_[static_cast<std::size_t>(i * inputs_ + j)];
      r2 += d[at] * d[at];
    }
    const double factor = 3 * std::sqrt(r2);
    const double* w = weights_.data() + static_cast<std::ptrdiff_t>(i) * outputs_;
    for (int j = 0; j < wrt; ++j) {
      const auto at = static_cast<std::size_t>(j);
      if (p.held[at]) continue;
      const double slope = factor * d[at];
      double* row = rows.data() + static_cast<std::ptrdiff_t>(j) * outputs_;
      for (int k = 0; k < outputs_; ++k) row[k] += slope * w[k];
    }
  }
  for (int k = 0; k < outputs_; ++k)
    for (int j = 0; j < wrt; ++j)
      jacobian[k * wrt + j] = rows[static_cast<std::size_t>(j * outputs_ + k)] * scale_[static_cast<std::size_t>(j)];
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
  std::vector<double> centers = centers_;
  const auto n = static_cast<std::size_t>(inputs_);
  for (std::size_t i = 0; i < centers.size(); ++i) centers[i] = centers[i] / scale_[i % n] + shift_[i % n];
  weights.tensors[prefix + ".shift"] = tensor_of(shift_, {inputs_});
  weights.tensors[prefix + ".scale"] = tensor_of(scale_, {inputs_});
  weights.tensors[prefix + ".centers"] = tensor_of(centers, {count_, inputs_});
  weights.tensors[prefix + ".weights"] = tensor_of(weights_, {count_, outputs_});
  weights.tensors[prefix + ".linear"] = tensor_of(linear_, {1 + inputs_, outputs_});
}

}  // namespace graupel::rom
