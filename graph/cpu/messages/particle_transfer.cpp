// The offset of a pair is (centre - x)/R = corner - o with corner in {0,1}^3 and o in [0,1]^3 the particle's place
// between its cells. The first layer is linear, so the corner's part is one of 8 table rows, and o's part is added once
// a particle. The mean-free second layer makes the sum over pairs  gamma sum(w s y) + beta sum(w)  (nn/fcn.h).
#include "graph/cpu/messages/particle_transfer.h"

#include <algorithm>

#include "graph/cpu/layer_weights.h"
#include "graph/topology/offset_tables.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {
constexpr int32_t particles_in_tile = tile_rows / 8;
}

ParticleTransfer::ParticleTransfer(const nn::Weights& weights, const LayerPlan& plan)
    : width_(width_of(plan)),
      p2g_scale_(static_cast<float>(plan.scale_of(plan.blocks.front()))),
      encoder_(weights, plan),
      decoder_(weights, plan) {
  const FcnWeights p2g = load(weights, plan.layers_of(plan.blocks.front()).front());
  const FcnWeights g2p = load(weights, plan.layers_of(plan.blocks.back()).front());
  const int h = p2g.out;
  particle_part_ = nn::StackedLinear(h, {{&p2g, 0, Bias::with}, {&g2p, h, Bias::with}});
  p2g_corner_ = nn::InputTable(p2g, h, corner_offsets(1));
  p2g_axis_ = nn::InputTable(p2g, h, axis_offsets(-1));
  p2g_second_ = nn::NormalizedLayer(p2g);
  g2p_corner_ = nn::InputTable(g2p, 2 * h, corner_offsets(-1));
  g2p_axis_ = nn::InputTable(g2p, 2 * h, axis_offsets(1));
  g2p_second_ = nn::NormalizedLayer(g2p);
  g2p_cell_part_ = g2p.first_layer_part(0, h, Bias::without);
}

void ParticleTransfer::encode(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                              const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const {
  workspace.particle.resize_discard(particle_type.size() * static_cast<std::size_t>(width_));
  workspace.particle_part.resize_discard(2 * workspace.particle.size());
  for_each_range(workspace, static_cast<int64_t>(particle_type.size()), tile_rows,
                 [&](int32_t begin, int32_t end, TileScratch& scratch) {
                   encode_tile(begin, end, features, particle_type, hierarchy, workspace, scratch);
                 });
}

void ParticleTransfer::encode_tile(int32_t begin, int32_t end, const std::vector<float>& features,
                                   const std::vector<int32_t>& particle_type, const sparsegrid::Hierarchy<3>& hierarchy,
                                   Workspace& workspace, TileScratch& scratch) const {
  const int rows = end - begin;
  const int32_t* order = workspace.topology.order.data() + begin;
  float* latent = workspace.particle.data() + static_cast<int64_t>(begin) * width_;
  encoder_.apply(order, rows, features, particle_type, scratch, latent);

  float* part = workspace.particle_part.data() + static_cast<int64_t>(begin) * 2 * width_;
  particle_part_.linear().apply(latent, width_, rows, part, 2 * width_);
  for (int r = 0; r < rows; ++r, part += 2 * width_) {
    const Vec3f& offset = hierarchy.offset[static_cast<std::size_t>(order[r])];
    for (int axis = 0; axis < 3; ++axis) {
      nn::add_scaled_row(part, offset[axis], p2g_axis_.row(axis), width_);
      nn::add_scaled_row(part + width_, offset[axis], g2p_axis_.row(axis), width_);
    }
  }
}

void ParticleTransfer::particle_to_grid(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const {
  for_each_tile(workspace, workspace.topology.pair_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    gather_tile(begin, end, hierarchy, workspace, scratch);
  });
}

/// Cells [begin, end): their pairs in runs of at most tile_rows, each pair added to its cell in the order of the list.
void ParticleTransfer::gather_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy,
                                   Workspace& workspace, TileScratch& scratch) const {
  const GraphTopology& topology = workspace.topology;
  const int32_t* first_pair = topology.pair_begin.data();
  float* cells = workspace.cell[0].data();
  for (int32_t c = begin; c < end; ++c) nn::clear_row(cells + static_cast<int64_t>(c) * width_, width_);
  int32_t cell = begin;
  float total_weight = 0;
  const auto finish_cell = [&] {
    float* sum = cells + static_cast<int64_t>(cell) * width_;
    nn::scale_sum(sum, p2g_scale_, p2g_second_.gamma(), p2g_scale_ * total_weight, p2g_second_.beta(), width_);
    ++cell;
    total_weight = 0;
  };
  for (int32_t run = first_pair[begin]; run < first_pair[end]; run += tile_rows) {
    const int32_t rows = std::min(tile_rows, first_pair[end] - run);
    const int32_t* pairs = topology.pair.data() + run;
    for (int32_t r = 0; r < rows; ++r) {
      const float* part = workspace.particle_part.data() + static_cast<int64_t>(pairs[r] / 8) * 2 * width_;
      nn::activate_sum(scratch.hidden.data() + r * width_, part, p2g_corner_.row(pairs[r] % 8), width_);
    }
    p2g_second_.apply(scratch.hidden.data(), rows, scratch.output.data());
    for (int32_t r = 0; r < rows; ++r) {
      while (run + r >= first_pair[cell + 1]) finish_cell();
      const auto particle = static_cast<std::size_t>(topology.order[static_cast<std::size_t>(pairs[r] / 8)]);
      const float weight = hierarchy.weight[particle][static_cast<std::size_t>(pairs[r] % 8)];
      const float* y = scratch.output.data() + r * width_;
      total_weight += weight;
      nn::add_scaled_row(cells + static_cast<int64_t>(cell) * width_, weight * p2g_second_.scale(y), y, width_);
    }
  }
  while (cell < end) finish_cell();
}

void ParticleTransfer::grid_to_particle(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                                        std::vector<float>& acceleration) const {
  const auto cells = static_cast<int64_t>(hierarchy.levels[0].size());
  workspace.cell_part.resize_discard(workspace.cell[0].size());
  for_each_range(workspace, cells, tile_rows, [&](int32_t begin, int32_t end, TileScratch&) {
    g2p_cell_part_.apply(workspace.cell[0].data() + static_cast<int64_t>(begin) * width_, width_, end - begin,
                         workspace.cell_part.data() + static_cast<int64_t>(begin) * width_, width_);
  });
  for_each_range(workspace, static_cast<int64_t>(hierarchy.cell.size()), particles_in_tile,
                 [&](int32_t begin, int32_t end, TileScratch& scratch) {
                   decode_tile(begin, end, hierarchy, workspace, scratch, acceleration);
                 });
}

void ParticleTransfer::decode_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy,
                                   Workspace& workspace, TileScratch& scratch, std::vector<float>& acceleration) const {
  const int32_t* order = workspace.topology.order.data() + begin;
  const int particles = end - begin;
  for (int p = 0; p < particles; ++p) {
    const auto& cells = hierarchy.cell[static_cast<std::size_t>(order[p])];
    const float* part = workspace.particle_part.data() + (static_cast<int64_t>(begin + p) * 2 + 1) * width_;
    for (int k = 0; k < 8; ++k)
      nn::activate_sum(scratch.hidden.data() + (p * 8 + k) * width_, part, g2p_corner_.row(k),
                       workspace.cell_part.data() + static_cast<int64_t>(cells[static_cast<std::size_t>(k)]) * width_,
                       width_);
  }
  g2p_second_.apply(scratch.hidden.data(), particles * 8, scratch.output.data());
  for (int p = 0; p < particles; ++p) {
    const auto& weights = hierarchy.weight[static_cast<std::size_t>(order[p])];
    float* sum = scratch.sums.data() + p * width_;
    float total_weight = 0;
    nn::clear_row(sum, width_);
    for (int k = 0; k < 8; ++k) {
      const float* y = scratch.output.data() + (p * 8 + k) * width_;
      const float weight = weights[static_cast<std::size_t>(k)];
      total_weight += weight;
      nn::add_scaled_row(sum, weight * g2p_second_.scale(y), y, width_);
    }
    const float* latent = workspace.particle.data() + static_cast<int64_t>(begin + p) * width_;
    nn::scale_sum(sum, 1, g2p_second_.gamma(), total_weight, g2p_second_.beta(), width_, latent);
  }
  decoder_.apply(scratch.sums.data(), order, particles, scratch, acceleration);
}

}  // namespace graupel::graph
