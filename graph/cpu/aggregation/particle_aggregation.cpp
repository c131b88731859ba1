// The offset of a pair is (centre - x)/R = corner - o with corner in {0,1}^3 and o in [0,1]^3 the particle's place
// between its cells: the corner's part is one of 8 table rows, and o's part is added once a particle. Particles are
// sorted by the cell of their corner 0, so a cell finds those that reach it with corner k beside each other, in the
// cell that lies `k` lower.
#include "graph/cpu/aggregation/particle_aggregation.h"

#include "graph/cpu/layer_weights.h"
#include "graph/topology/offset_tables.h"
#include "nn/activated_sums.h"
#include "nn/matrix_extension_mlp.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {
constexpr int corners = 8;
}

ParticleAggregation::ParticleAggregation(const nn::Weights& weights, const LayerPlan& plan)
    : width_(width_of(plan)),
      p2g_scale_(static_cast<float>(plan.scale_of(plan.blocks.front()))),
      encoder_(weights, plan),
      decoder_(weights, plan) {
  const std::vector<PlanLayer> to_cells = plan.layers_of(plan.blocks.front());
  const std::vector<PlanLayer> to_particles = plan.layers_of(plan.blocks.back());
  const FcnWeights p2g = load(weights, to_cells[0]);
  const int h = p2g.out;
  p2g_part_ = p2g.first_layer_part(0, h, Bias::with);
  p2g_corner_ = nn::InputTable(p2g, h, corner_offsets(1));
  p2g_axis_ = nn::InputTable(p2g, h, axis_offsets(-1));
  cell_network_ = ReceiverNetwork(load(weights, to_cells[1]), ReceiverNetwork::Inputs::sum);
  const FcnWeights g2p = load(weights, to_particles[0]);
  g2p_cell_part_ = g2p.first_layer_part(0, h, Bias::without);
  g2p_part_ = g2p.first_layer_part(h, h, Bias::with);
  g2p_corner_ = nn::InputTable(g2p, 2 * h, corner_offsets(-1));
  g2p_axis_ = nn::InputTable(g2p, 2 * h, axis_offsets(1));
  particle_network_ = ReceiverNetwork(load(weights, to_particles[1]), ReceiverNetwork::Inputs::sum_and_latent);
}

void ParticleAggregation::add_offset(const Vec3f& offset, const nn::InputTable& axis, float* part) const {
  nn::add_three_rows(part, {offset[0], offset[1], offset[2]}, {axis.row(0), axis.row(1), axis.row(2)}, width_);
}

void ParticleAggregation::encode(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                                 const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace) const {
  const auto count = static_cast<int64_t>(particle_type.size());
  for_each_range(workspace, count, sum_rows(count), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    encode_tile(begin, end, features, particle_type, hierarchy, workspace, scratch);
  });
}

void ParticleAggregation::encode_tile(int32_t begin, int32_t end, const std::vector<float>& features,
                                      const std::vector<int32_t>& particle_type,
                                      const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace,
                                      TileScratch& scratch) const {
  const int rows = end - begin;
  float* const latent = workspace.particle.data() + int64_t{begin} * width_;
  const float* const hidden =
      encoder_.hidden(workspace.topology.order.data() + begin, rows, features, particle_type, scratch);
  const NextLayerRows part = grid_rows(begin, scratch.sums.data(), workspace);
  finish_latents(encoder_.last(), hidden, rows, false, latent, part, scratch);
  leave_for_grid(begin, end, part, hierarchy, workspace);
}

NextLayerRows ParticleAggregation::grid_rows(int32_t begin, float* spare, AggregationWorkspace& workspace) const {
  return {.layer = p2g_part_, .floats = workspace.on_units ? spare : workspace.particle_part.row<float>(begin, width_)};
}

void ParticleAggregation::leave_for_grid(int32_t begin, int32_t end, const NextLayerRows& part,
                                         const sparsegrid::Hierarchy<3>& hierarchy,
                                         AggregationWorkspace& workspace) const {
  for (int32_t place = begin; place < end; ++place) {
    const auto particle = static_cast<std::size_t>(workspace.topology.order[static_cast<std::size_t>(place)]);
    add_offset(hierarchy.offset[particle], p2g_axis_, part.floats + int64_t{place - begin} * width_);
    std::copy_n(hierarchy.weight[particle].data(), corners, workspace.weight.data() + int64_t{place} * corners);
  }
  if (workspace.on_units)
    nn::pack_rows(part.floats, end - begin, width_, workspace.particle_part.row<uint32_t>(begin, width_));
}

void ParticleAggregation::particle_to_grid(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
                                           AggregationWorkspace& workspace) const {
  const auto& cells = hierarchy.levels[0];
  const auto count = static_cast<int64_t>(cells.size());
  for_each_range(workspace, count, sum_rows(count), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    with_rows(workspace, [&](auto word) {
      for (int32_t c = begin; c < end; ++c)
        gather_to_cell<decltype(word)>(cells, c, workspace, cell_network_.sum(scratch, c - begin));
    });
    float* const latent = workspace.cell[0].data() + int64_t{begin} * width_;
    cell_network_.apply(scratch, end - begin, latent, workspace.next_rows(next_layer, begin));
  });
  workspace.advance();
}

template <typename Word>
void ParticleAggregation::gather_to_cell(const sparsegrid::HierarchyLevel<3>& cells, int32_t cell,
                                         const AggregationWorkspace& workspace, float* sum) const {
  // The cell that lies k lower; -1 also where only a way over cells that are not active leads there: a particle there
  // would make the cells of the way active.
  int32_t base[corners] = {cell};
  constexpr int most = 64;
  nn::ActivatedRow<Word> pairs[most];
  int count = 0;
  const auto add_pairs = [&] {
    nn::add_activated(width_, count, pairs, sum);
    count = 0;
  };
  nn::clear_row(sum, width_);
  for (int k = 0; k < corners; ++k) {
    if (k > 0) {
      const int axis = k >= 4 ? 2 : k >= 2 ? 1 : 0, before = k - (1 << axis);
      base[k] = base[before] < 0
                    ? -1
                    : cells.neighbor[static_cast<std::size_t>(base[before])][static_cast<std::size_t>(2 * axis)];
    }
    if (base[k] < 0) continue;
    const int32_t* const begin = workspace.topology.base_begin.data() + base[k];
    for (int32_t place = begin[0]; place < begin[1]; ++place) {
      pairs[count++] = {workspace.particle_part.row<Word>(place, width_), p2g_corner_.row(k),
                        p2g_scale_ * workspace.weight[static_cast<std::size_t>(place * corners + k)]};
      if (count == most) add_pairs();
    }
  }
  add_pairs();
}

void ParticleAggregation::grid_to_particle(const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace,
                                           std::vector<float>& acceleration) const {
  const auto count = static_cast<int64_t>(hierarchy.cell.size());
  for_each_range(workspace, count, sum_rows(count), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    decode_tile(begin, end, hierarchy, workspace, scratch, acceleration);
  });
}

void ParticleAggregation::decode_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy,
                                      AggregationWorkspace& workspace, TileScratch& scratch,
                                      std::vector<float>& acceleration) const {
  const int32_t* const order = workspace.topology.order.data() + begin;
  const int rows = end - begin;
  float* const latent = workspace.particle.data() + int64_t{begin} * width_;
  float* const part = scratch.hidden.data();
  g2p_part_.apply(latent, width_, rows, part, width_);
  for (int r = 0; r < rows; ++r) {
    const auto particle = static_cast<std::size_t>(order[r]);
    float* const own = part + int64_t{r} * width_;
    add_offset(hierarchy.offset[particle], g2p_axis_, own);
    with_rows(workspace, [&](auto word) {
      gather_to_particle<decltype(word)>(particle, hierarchy, workspace, own, particle_network_.sum(scratch, r));
    });
  }
  particle_network_.apply(scratch, rows, latent, {.layer = decoder_.first(), .floats = scratch.hidden.data()});
  decoder_.after_first(order, rows, scratch, acceleration);
}

template <typename Word>
void ParticleAggregation::gather_to_particle(std::size_t particle, const sparsegrid::Hierarchy<3>& hierarchy,
                                             const AggregationWorkspace& workspace, const float* own,
                                             float* sum) const {
  const auto& cells = hierarchy.cell[particle];
  const auto& weight = hierarchy.weight[particle];
  nn::ActivatedRow<Word> rows[corners];
  for (int k = 0; k < corners; ++k) {
    const auto corner = static_cast<std::size_t>(k);
    rows[k] = {workspace.current.row<Word>(cells[corner], width_), g2p_corner_.row(k), weight[corner]};
  }
  nn::sum_activated(width_, corners, rows, own, sum);
}

}  // namespace graupel::graph
