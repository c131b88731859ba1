// A smooth map R^n -> R^m as a small network on top of a linear part,
//   c(z) = b + L y + N(z),   y = (z - shift) * scale, the network's own standardised input (rom/networks/mlp.h).
// The network learns only what the straight line leaves. ELU is asymptotically linear, so that far outside of the data
// the map goes on as a straight line by itself.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rom/fields/branch_map.h"
#include "rom/networks/mlp.h"

namespace graupel::rom {

class MlpMap final : public BranchMap {
 public:
  /// `linear` [1 + inputs, outputs], the constant first.
  MlpMap(Mlp network, const std::vector<double>& linear);

  BranchKind kind() const override { return BranchKind::mlp; }
  int inputs() const override { return network_.inputs(); }
  int outputs() const override { return network_.outputs(); }
  const Mlp& network() const { return network_; }

  void evaluate(const double* z, double* c) const override;
  void derivative(const double* z, int wrt, double* jacobian) const override;

  /// Tensors of Mlp::load, and <prefix>.linear [1 + inputs, outputs]. Throws InputError as it does.
  static MlpMap load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs);
  void store(nn::Weights& weights, const std::string& prefix) const override;

 private:
  Mlp network_;
  Eigen::MatrixXd linear_;  ///< [outputs, 1 + inputs], in the precision that files keep
};

}  // namespace graupel::rom
