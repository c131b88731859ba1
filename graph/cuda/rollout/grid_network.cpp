#include "graph/cuda/forward/grid_network.h"

#include <string>

#include "core/system/error.h"
#include "graph/cuda/forward/message_network.h"
#include "graph/cuda/persistent/persistent_hgn.h"

namespace graupel::graph {

std::unique_ptr<GridNetwork> make_grid_network(const HgnConfig& config, const nn::Weights& weights) {
  if (PersistentHgn::fits(config)) return std::make_unique<PersistentHgn>(config, weights);
  if (config.aggregation == Aggregation::messages && PackedNetwork::fits(plan_of(config)))
    return std::make_unique<MessageNetwork>(config, weights);
  throw ConfigError("'" + weights.file + "': networks run on a GPU with a latent width of " +
                    std::to_string(layer_width) +
                    " and at most 128 inputs only (hgn.latent: " + std::to_string(config.latent) +
                    ", inputs: " + std::to_string(config.input_width()) + "). Use device 'cpu'");
}

}  // namespace graupel::graph
