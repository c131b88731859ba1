#include "graph/cpu/workspace.h"

#include <algorithm>

namespace graupel::graph {

void Workspace::prepare(int width, int features) {
  const auto w = static_cast<std::size_t>(width);
  std::size_t cells = 0, edges = 0;
  cell.resize(topology.levels.size());
  for (std::size_t l = 0; l < topology.levels.size(); ++l) {
    const auto n = static_cast<std::size_t>(topology.levels[l].cells);
    cell[l].resize_discard(n * w);
    cells = std::max(cells, n);
    edges = std::max(edges, static_cast<std::size_t>(topology.levels[l].edges));
  }
  for (auto& buffer : projection) buffer.resize_discard(cells * 3 * w);
  edge.resize_discard(edges * w);
  prepare_scratch(scratch, width, features);
}

}  // namespace graupel::graph
