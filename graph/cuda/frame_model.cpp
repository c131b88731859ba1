#include "graph/cuda/frame_model.h"

#include "core/error.h"
#include "graph/config_metadata.h"
#include "graph/cuda/gns_frame.h"
#include "graph/cuda/hgn_frame.h"

namespace graupel::graph {

std::unique_ptr<FrameModel> make_frame_model(const nn::Weights& weights) {
  if (architecture_of(weights) == gns_architecture) return std::make_unique<GnsFrame>(weights);
  return std::make_unique<HgnFrame>(weights);  // refuses any other
}

}  // namespace graupel::graph
