#include "rom/fields/branch_map.h"

#include "core/system/error.h"
#include "rom/fields/coefficient_map.h"
#include "rom/fields/mlp_map.h"

namespace graupel::rom {

std::shared_ptr<const BranchMap> load_branch_map(const nn::Weights& weights, const std::string& prefix, BranchKind kind,
                                                 int inputs, int outputs) {
  if (kind == BranchKind::mlp) return std::make_shared<const MlpMap>(MlpMap::load(weights, prefix, inputs, outputs));
  return std::make_shared<const CoefficientMap>(CoefficientMap::load(weights, prefix, inputs, outputs));
}

BranchKind read_branch_kind(const nn::Weights& weights) {
  const auto at = weights.metadata.find("branch");
  if (at == weights.metadata.end()) return BranchKind::rbf;
  for (const auto& [word, kind] : EnumWords<BranchKind>::words)
    if (at->second == word) return kind;
  throw InputError("'" + weights.file + "' has branches of an unknown kind ('" + at->second +
                   "', allowed: rbf, mlp). Use the version of Graupel that it was trained with");
}

}  // namespace graupel::rom
