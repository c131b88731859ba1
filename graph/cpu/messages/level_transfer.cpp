#include "graph/cpu/messages/level_transfer.h"

#include <cstring>

#include "graph/cpu/layer_weights.h"
#include "graph/topology/offset_tables.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

LevelTransfer::LevelTransfer(const nn::Weights& weights, const LayerPlan& plan, int level)
    : level_(static_cast<std::size_t>(level)), width_(width_of(plan)) {
  const auto layer_of = [&](LinkKind kind) { return plan.layers_of(plan.block_of({kind, level})).front(); };
  const FcnWeights down = load(weights, layer_of(LinkKind::to_parent));
  const int h = down.out;
  restrict_first_ = down.first_layer_part(0, h, Bias::with);
  restrict_octant_ = nn::InputTable(down, h, octant_offsets(-1));
  restrict_second_ = nn::NormalizedLayer(down);
  const FcnWeights up = load(weights, layer_of(LinkKind::from_parent));
  prolong_coarse_part_ = up.first_layer_part(0, h, Bias::with);
  prolong_fine_part_ = up.first_layer_part(h, h, Bias::without);
  prolong_octant_ = nn::InputTable(up, 2 * h, octant_offsets(1));
  prolong_second_ = nn::NormalizedLayer(up);
}

void LevelTransfer::restrict_to_coarse(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const {
  const HostLinks& links = workspace.topology.levels[level_];
  const auto& octant = hierarchy.levels[level_].octant;
  const float* fine_latent = workspace.cell[level_].data();
  for_each_tile(workspace, links.child_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    const int32_t* first_child = links.child_begin.data();
    const int32_t first = first_child[begin], rows = first_child[end] - first;
    const int32_t* child = links.child.data() + first;
    for (int32_t r = 0; r < rows; ++r)
      std::memcpy(scratch.input.data() + r * width_, fine_latent + static_cast<int64_t>(child[r]) * width_,
                  sizeof(float) * static_cast<std::size_t>(width_));
    restrict_first_.apply(scratch.input.data(), width_, rows, scratch.hidden.data(), width_);
    for (int32_t r = 0; r < rows; ++r) {
      float* hidden = scratch.hidden.data() + r * width_;
      nn::activate_sum(hidden, hidden, restrict_octant_.row(octant[static_cast<std::size_t>(child[r])]), width_);
    }
    restrict_second_.apply(scratch.hidden.data(), rows, scratch.output.data());
    for (int32_t c = begin; c < end; ++c) {
      float* sum = workspace.cell[level_ + 1].data() + static_cast<int64_t>(c) * width_;
      nn::clear_row(sum, width_);
      for (int32_t r = first_child[c] - first; r < first_child[c + 1] - first; ++r)
        restrict_second_.add_to(sum, scratch.output.data() + r * width_);
    }
  });
}

void LevelTransfer::prolong_to_fine(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const {
  const auto& fine = hierarchy.levels[level_];
  const auto coarse_cells = static_cast<int64_t>(hierarchy.levels[level_ + 1].size());
  workspace.cell_part.resize_discard(workspace.cell[level_ + 1].size());
  for_each_range(workspace, coarse_cells, tile_rows, [&](int32_t begin, int32_t end, TileScratch&) {
    const int64_t first = static_cast<int64_t>(begin) * width_;
    prolong_coarse_part_.apply(workspace.cell[level_ + 1].data() + first, width_, end - begin,
                               workspace.cell_part.data() + first, width_);
  });
  for_each_range(
      workspace, static_cast<int64_t>(fine.size()), tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
        float* latent = workspace.cell[level_].data() + static_cast<int64_t>(begin) * width_;
        const int32_t rows = end - begin;
        prolong_fine_part_.apply(latent, width_, rows, scratch.hidden.data(), width_);
        for (int32_t r = 0; r < rows; ++r) {
          const auto c = static_cast<std::size_t>(begin + r);
          float* hidden = scratch.hidden.data() + r * width_;
          nn::activate_sum(hidden, hidden, prolong_octant_.row(fine.octant[c]),
                           workspace.cell_part.data() + static_cast<int64_t>(fine.parent[c]) * width_, width_);
        }
        prolong_second_.apply(scratch.hidden.data(), rows, scratch.output.data());
        for (int32_t r = 0; r < rows; ++r)
          prolong_second_.add_to(latent + r * width_, scratch.output.data() + r * width_);
      });
}

}  // namespace graupel::graph
