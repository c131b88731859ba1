#include "graph/sums/sum_workspace.h"

namespace graupel::graph {

void SumWorkspace::prepare(const sparsegrid::Hierarchy<3>& hierarchy, int width, int features) {
  const auto w = static_cast<std::size_t>(width);
  const std::size_t particles = hierarchy.cell.size();
  particle.resize_discard(particles * w);
  particle_part.resize_discard(particles * w);
  weight.resize_discard(particles * SumTopology::corners);
  std::size_t cells = 0;
  cell.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l) {
    cell[l].resize_discard(hierarchy.levels[l].size() * w);
    cells = std::max(cells, hierarchy.levels[l].size());
  }
  now.resize_discard(cells * 2 * w);
  next.resize_discard(cells * 2 * w);
  prepare_scratch(scratch, width, features);
}

}  // namespace graupel::graph
