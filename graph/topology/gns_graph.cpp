#include "graph/topology/gns_graph.h"

#include <algorithm>

#include "sparsegrid/cell_list.h"

namespace graupel::graph {

void GnsGraph::build(const std::vector<Vec3f>& unsorted, double radius) {
  order = sparsegrid::CellList(unsorted, radius).point();
  position.clear();
  for (const int32_t p : order) position.push_back(unsorted[static_cast<std::size_t>(p)]);
  links = sparsegrid::build_radius_graph(position, radius, sparsegrid::SelfEdges::with);
  receiver.resize(links.sender.size());
  for (int32_t r = 0; r < links.points(); ++r)
    std::fill(receiver.begin() + links.begin[static_cast<std::size_t>(r)],
              receiver.begin() + links.begin[static_cast<std::size_t>(r) + 1], r);
}

}  // namespace graupel::graph
