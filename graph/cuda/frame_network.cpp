#include "graph/cuda/frame_network.h"

#include "core/error.h"
#include "graph/config_metadata.h"
#include "graph/cuda/gns_frame.h"
#include "graph/cuda/hgn_frame.h"

namespace graupel::graph {

std::unique_ptr<FrameNetwork> make_frame_network(const nn::Weights& weights) {
  if (architecture_of(weights) == gns_architecture) return std::make_unique<GnsFrame>(weights);
  return std::make_unique<HgnFrame>(weights);  // refuses any other
}

}  // namespace graupel::graph
