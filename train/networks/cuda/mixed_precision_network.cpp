#include "train/networks/mixed_precision_network.h"

#include "core/system/error.h"
#include "train/networks/cuda/fused_gns.h"
#include "train/networks/cuda/fused_hgn.h"

namespace graupel::train {

std::unique_ptr<MixedPrecisionNetwork> make_mixed_precision_network(const NetworkConfig& config,
                                                                    int64_t checkpoint_layers,
                                                                    const ParameterLayout& layout,
                                                                    const at::Tensor& flat,
                                                                    const at::Tensor& gradient) {
  const auto* hgn = std::get_if<graph::HgnConfig>(&config);
  const auto* gns = std::get_if<graph::GnsConfig>(&config);
  if (gns && gns->hidden_layers > 1)
    throw ConfigError("networks of several hidden layers have no kernels in mixed precision (gns.hidden_layers: " +
                      std::to_string(gns->hidden_layers) + ", with kernels: 1). Set mixed_precision=false");
  if (!graph::PackedNetwork::fits(layout.plan())) return nullptr;
  if (gns) return std::make_unique<FusedGns>(layout, checkpoint_layers, flat, gradient);
  if (hgn->aggregation != graph::Aggregation::activations) return nullptr;
  return std::make_unique<FusedHgn>(layout, flat, gradient);
}

}  // namespace graupel::train
