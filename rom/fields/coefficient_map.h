// A smooth map R^n -> R^m from scattered values: radial basis functions with a linear part,
//   c(z) = b + L y + sum_i w_i |y - y_i|^3,   y = (z - shift) * scale.
// The cubic kernel grows fast outside of its data, so there y is clamped to the data's box (widened by a tenth) for the
// radial part, and the linear part alone goes on.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "rom/fields/branch_map.h"

namespace graupel::rom {

class CoefficientMap final : public BranchMap {
 public:
  CoefficientMap() = default;
  /// `centers` [k, inputs] in the inputs' own units, `weights` [k, outputs], `linear` [1 + inputs, outputs], the
  /// constant first.
  CoefficientMap(int inputs, int outputs, std::vector<double> shift, std::vector<double> scale,
                 const std::vector<double>& centers, const std::vector<double>& weights,
                 const std::vector<double>& linear);

  BranchKind kind() const override { return BranchKind::rbf; }
  int inputs() const override { return inputs_; }
  int outputs() const override { return outputs_; }
  void evaluate(const double* z, double* c) const override;
  void derivative(const double* z, int wrt, double* jacobian) const override;

  /// Tensors <prefix>.shift, .scale [inputs], .centers [k, inputs], .weights [k, outputs], .linear [1 + inputs,
  /// outputs]. Throws InputError for one that is missing, of another shape or not finite.
  static CoefficientMap load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs);
  void store(nn::Weights& weights, const std::string& prefix) const override;

  /// The numbers themselves, for other implementations of evaluate().
  struct Parts {
    int count;
    std::vector<double> shift, scale, low, high;  ///< [inputs]; the box is standardised
    std::vector<double> centers;                  ///< standardised [inputs, count]
    std::vector<double> weights;                  ///< [outputs, count]
    std::vector<double> linear;                   ///< [outputs, 1 + inputs]
  };
  Parts parts() const;

 private:
  /// Standardised z, and the same clamped to the data's box; `clamped[j]`: input j is.
  struct Place {
    Eigen::VectorXd y, inside;
    std::vector<bool> clamped;
  };
  Place place(const double* z) const;
  /// |y - y_i|^2, [count].
  Eigen::ArrayXd squared_distances(const Eigen::VectorXd& y) const;

  int inputs_ = 0, outputs_ = 0, count_ = 0;
  std::vector<double> shift_, scale_;
  Eigen::ArrayXXd centers_;         ///< standardised [count, inputs]
  Eigen::MatrixXd weights_;         ///< [outputs, count]
  Eigen::MatrixXd linear_;          ///< [outputs, 1 + inputs]
  std::vector<double> low_, high_;  ///< box of the radial part, standardised [inputs]
};

}  // namespace graupel::rom
