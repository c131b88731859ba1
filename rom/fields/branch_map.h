// The map from the latent state to the coefficients of a factored field's modes, c(z) with z = q or (q, mu).
#pragma once

#include <memory>
#include <string>

#include "core/scene/fields.h"
#include "nn/weights.h"

namespace graupel::rom {

/// What such a map is; `branch` in the metadata of a weights file.
enum class BranchKind {
  rbf,  ///< radial basis functions (rom/fields/coefficient_map.h)
  mlp   ///< a network (rom/fields/mlp_map.h)
};

constexpr auto enum_list(BranchKind) {
  return std::to_array<std::pair<const char*, BranchKind>>({{"rbf", BranchKind::rbf}, {"mlp", BranchKind::mlp}});
}

class BranchMap {
 public:
  virtual ~BranchMap() = default;
  virtual BranchKind kind() const = 0;
  virtual int inputs() const = 0;
  virtual int outputs() const = 0;

  /// c(z), [outputs].
  virtual void evaluate(const double* z, double* c) const = 0;
  /// dc/dz_j for the first `wrt` inputs, [outputs, wrt].
  virtual void derivative(const double* z, int wrt, double* jacobian) const = 0;

  virtual void store(nn::Weights& weights, const std::string& prefix) const = 0;
};

/// Throws InputError naming the file for a tensor that is missing, of another shape or not finite.
std::shared_ptr<const BranchMap> load_branch_map(const nn::Weights& weights, const std::string& prefix, BranchKind kind,
                                                 int inputs, int outputs);

/// What the file's branches are: radial basis functions where it says nothing, as files of earlier versions. Throws
/// InputError for an unknown word.
BranchKind read_branch_kind(const nn::Weights& weights);

}  // namespace graupel::rom
