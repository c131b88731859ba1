#include "graph/cpu/aggregation/aggregation_topology.h"

#include <numeric>

namespace graupel::graph {

void AggregationTopology::build(const sparsegrid::Hierarchy<3>& hierarchy) {
  const std::size_t cells = hierarchy.levels[0].size();
  base_begin.assign(cells + 1, 0);
  for (const auto& cell : hierarchy.cell) ++base_begin[static_cast<std::size_t>(cell[0]) + 1];
  std::partial_sum(base_begin.begin(), base_begin.end(), base_begin.begin());
  std::vector<int32_t> next(base_begin.begin(), base_begin.end() - 1);
  order.resize(hierarchy.cell.size());
  for (std::size_t p = 0; p < hierarchy.cell.size(); ++p)
    order[static_cast<std::size_t>(next[static_cast<std::size_t>(hierarchy.cell[p][0])]++)] = static_cast<int32_t>(p);

  children.resize(hierarchy.levels.size());
  for (std::size_t l = 1; l < hierarchy.levels.size(); ++l) {
    const auto& fine = hierarchy.levels[l - 1];
    Children none;
    none.fill(-1);
    children[l].assign(hierarchy.levels[l].size(), none);
    for (std::size_t c = 0; c < fine.size(); ++c)
      children[l][static_cast<std::size_t>(fine.parent[c])][fine.octant[c]] = static_cast<int32_t>(c);
  }
}

}  // namespace graupel::graph
