#include "rom/fields/mlp_map.h"

#include <utility>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

Mlp::Rows row_of(const double* z, Eigen::Index count) { return Eigen::Map<const Mlp::Rows>(z, 1, count); }

}  // namespace

MlpMap::MlpMap(Mlp network, const std::vector<double>& linear)
    : network_(std::move(network)),
      linear_(Eigen::Map<const Eigen::MatrixXd>(linear.data(), outputs(), 1 + inputs()).cast<float>().cast<double>()) {
  GRAUPEL_ASSERT(linear.size() == static_cast<std::size_t>(outputs()) * static_cast<std::size_t>(1 + inputs()));
}

void MlpMap::evaluate(const double* z, double* c) const {
  Mlp::Rows y;
  network_.evaluate(row_of(z, inputs()), y);
  Eigen::Map<Eigen::VectorXd> to(c, outputs());
  to = linear_.col(0) + y.row(0).transpose();
  const Standardization& s = network_.input();
  for (Eigen::Index j = 0; j < inputs(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    to += ((z[i] - s.shift[i]) * s.scale[i]) * linear_.col(1 + j);
  }
}

void MlpMap::derivative(const double* z, int wrt, double* jacobian) const {
  Mlp::Rows y, slopes;
  network_.tangents(row_of(z, inputs()), wrt, y, slopes);
  Eigen::Map<Mlp::Rows> to(jacobian, outputs(), wrt);
  for (Eigen::Index j = 0; j < wrt; ++j)
    to.col(j) = slopes.row(j).transpose() + network_.input().scale[static_cast<std::size_t>(j)] * linear_.col(1 + j);
}

MlpMap MlpMap::load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs) {
  const std::vector<float> linear = weights.get(prefix + ".linear", {1 + inputs, outputs});
  return {Mlp::load(weights, prefix, inputs, outputs), {linear.begin(), linear.end()}};
}

void MlpMap::store(nn::Weights& weights, const std::string& prefix) const {
  network_.store(weights, prefix);
  weights.tensors[prefix + ".linear"] =
      nn::Tensor::from_float({linear_.data(), linear_.data() + linear_.size()}, {1 + inputs(), outputs()});
}

}  // namespace graupel::rom
