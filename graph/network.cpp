#include "graph/network.h"

#include "core/system/error.h"
#include "graph/config/config_metadata.h"
#include "graph/networks/gns_network.h"
#include "graph/networks/hierarchical_graph_network.h"

namespace graupel::graph {

std::shared_ptr<const Network> load_network(const nn::Weights& weights) {
  const std::string architecture = architecture_of(weights);
  if (architecture == hgn_architecture) return std::make_shared<const HierarchicalGraphNetwork>(weights);
  if (architecture == gns_architecture) return std::make_shared<const GnsNetwork>(weights);
  throw InputError("'" + weights.file + "' holds no graph network (architecture '" + architecture + "', supported: '" +
                   hgn_architecture + "', '" + gns_architecture +
                   "'). Choose a weights file of one of these architectures");
}

}  // namespace graupel::graph
