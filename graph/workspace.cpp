#include "graph/workspace.h"

#include <algorithm>

namespace graupel::graph {

void Workspace::prepare(int width, int features) {
  const auto w = static_cast<std::size_t>(width);
  const std::size_t particles = topology.order.size();
  particle.resize_discard(particles * w);
  particle_part.resize_discard(particles * 2 * w);
  std::size_t cells = 0, edges = 0;
  cell.resize(topology.levels.size());
  for (std::size_t l = 0; l < topology.levels.size(); ++l) {
    const auto n = static_cast<std::size_t>(topology.levels[l].edges_in.receivers());
    cell[l].resize_discard(n * w);
    cells = std::max(cells, n);
    edges = std::max(edges, topology.levels[l].edges.size());
  }
  for (auto& buffer : projection) buffer.resize_discard(cells * 3 * w);
  edge.resize_discard(edges * w);
  cell_part.resize_discard(cells * w);
  scratch.resize(static_cast<std::size_t>(omp_get_max_threads()));
  const auto tile = static_cast<std::size_t>(tile_rows);
  for (TileScratch& thread : scratch) {
    for (Buffer<float>* buffer : {&thread.hidden, &thread.output, &thread.sums}) buffer->resize_discard(tile * w);
    thread.input.resize_discard(tile * std::max(w, static_cast<std::size_t>(features)));
  }
}

}  // namespace graupel::graph
