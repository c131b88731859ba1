// The map from the latent state to the coefficients of a factored field's modes, c(z) with z = q or (q, mu).
#pragma once

#include <memory>
#include <string>

#include "core/scene/fields.h"
#include "nn/weights.h"

namespace graupel {
namespace rom {

/// What such a map is; `branch` in the metadata of a weights file.
enum class BranchKind {
  rbf,  ///< radial basis functions (rom/fields/coefficient_map.h)
  mlp   ///< a network (rom/fields/mlp_map.h)
};

}  // namespace rom

template <>
struct EnumWords<rom::BranchKind> {
  static constexpr std::pair<const char*, rom::BranchKind> words[] = {{"rbf", rom::BranchKind::rbf},
                                                                      {"mlp", rom::BranchKind::mlp}};
};

namespace rom {

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

}  // namespace rom
}  // namespace graupel
