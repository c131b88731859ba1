#include "train/config/network_config.h"

#include "graph/config/config_metadata.h"

namespace graupel::train {

NetworkConfig network_config_of(const nn::Weights& weights) {
  if (graph::architecture_of(weights) == graph::gns_architecture) {
    graph::check_architecture(weights, graph::gns_architecture, graph::gns_format_version, "GNS");
    return graph::GnsConfig::from_metadata(weights.metadata, weights.file);
  }
  graph::check_architecture(weights, graph::hgn_architecture, graph::hgn_format_version, "graph network");
  return graph::HgnConfig::from_metadata(weights.metadata, weights.file);
}

}  // namespace graupel::train
