#include "graph/cpu/aggregation/aggregation_workspace.h"

#include "nn/bf16_gemm.h"
#include "nn/linear.h"
#include "nn/matrix_extension_mlp.h"

namespace graupel::graph {

void AggregationWorkspace::prepare(const sparsegrid::Hierarchy<3>& hierarchy, int latent, int features) {
  const int width = nn::padded_width(latent);
  on_units = nn::uses_bf16_gemm() && latent == width && nn::suits_bf16_units(latent) && latent <= nn::most_chain_width;
  const auto w = static_cast<std::size_t>(width);
  const std::size_t particles = hierarchy.cell.size();
  particle.resize_discard(particles * w);
  particle_part.resize(particles, width);
  weight.resize_discard(particles * 8);
  std::size_t cells = 0;
  cell.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l) {
    cell[l].resize_discard(hierarchy.levels[l].size() * w);
    cells = std::max(cells, hierarchy.levels[l].size());
  }
  current.resize(cells, 2 * width);
  next.resize(cells, 2 * width);
  prepare_scratch(scratch, width, features);
}

}  // namespace graupel::graph
