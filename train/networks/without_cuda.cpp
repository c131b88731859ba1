// Stands in for cuda/mixed_passes.cpp in a build without CUDA.
#include "train/networks/mixed_passes.h"

namespace graupel::train {

std::unique_ptr<MixedPasses> make_mixed_passes(const NetworkConfig&, int64_t, const ParameterLayout&, const at::Tensor&,
                                               const at::Tensor&) {
  return nullptr;
}

}  // namespace graupel::train
