#include "graph/cuda/rollout/frame_model.h"

#include "core/system/error.h"
#include "graph/config/network_config.h"
#include "graph/cuda/rollout/gns_frame.h"
#include "graph/cuda/rollout/hgn_frame.h"

namespace graupel::graph {

std::unique_ptr<FrameModel> make_frame_model(const nn::Weights& weights) {
  if (architecture_of(weights) == gns_architecture) return std::make_unique<GnsFrame>(weights);
  return std::make_unique<HgnFrame>(weights);  // refuses any other
}

}  // namespace graupel::graph
