// Stands in for cuda/mixed_precision_network.cpp in a build without CUDA.
#include "train/networks/mixed_precision_network.h"

namespace graupel::train {

std::unique_ptr<MixedPrecisionNetwork> make_mixed_precision_network(const NetworkConfig&, int64_t,
                                                                    const ParameterLayout&, const at::Tensor&,
                                                                    const at::Tensor&) {
  return nullptr;
}

}  // namespace graupel::train
