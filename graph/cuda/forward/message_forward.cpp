#include "graph/cuda/forward/message_forward.h"

#include "core/system/error.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

constexpr int corners = 8;
constexpr int64_t h = layer_width;

/// Row r of a [pairs, .] array belongs to particle r / 8 and corner r % 8.
constexpr RowOf by_particle{nullptr, 3, -1};
constexpr RowOf by_corner{nullptr, 0, corners - 1};
constexpr RowOf always_first{nullptr, 0, 0};

/// W_s f_s, and W_r f_r with the bias, of the first layer of an edge network, [cells].
struct Projections {
  float *sender = nullptr, *receiver = nullptr;
};

/// Results of one iteration of message passing.
struct IterationRows {
  Projections projections;
  uint16_t *message, *latent;  ///< [edges]
  RowLatents nodes;            ///< [cells]
};

class ForwardPass {
 public:
  ForwardPass(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, void* stream)
      : network_(network), graph_(graph), memory_(memory), stream_(stream), f_(graph.level.size()) {
    GRAUPEL_ASSERT(f_.size() == static_cast<std::size_t>(network.config().levels));
  }

  float* run(const std::function<void()>& grid_ready) {
    FusedMlp encoder;
    particles_ = encode_particles(network_, graph_, memory_, encoder, stream_);
    if (grid_ready) grid_ready();
    run_blocks(network_.plan(), *this);
    return result_;
  }

  void particle_to_grid(const PlanBlock& block);
  void pass_messages(const PlanBlock& block);
  void restrict_to_coarse(const PlanBlock& block);
  void prolong_to_fine(const PlanBlock& block);
  void grid_to_particle(const PlanBlock& block);

 private:
  RowLatents latents(int64_t rows) { return {memory_.rows32(rows), memory_.rows16(rows)}; }
  Projections projections(const LevelLinks& level) {
    return {memory_.rows32(level.cells), memory_.rows32(level.cells)};
  }
  EpilogueProjection epilogue(const std::string& edge_name, const Projections& to) const {
    return {{network_.tile(edge_name, 0), network_.tile(edge_name, h)},
            {nullptr, network_.fcn(edge_name).b1},
            {to.sender, to.receiver}};
  }

  const PackedHgn& network_;
  const HgnGraph& graph_;
  RowMemory& memory_;
  void* stream_;
  std::vector<RowLatents> f_;  ///< cells of each level
  RowLatents particles_;
  Projections ahead_;  ///< of the next block's first iteration, where they are there already
  FusedMlp to_particle_;
  float* result_ = nullptr;
};

void ForwardPass::particle_to_grid(const PlanBlock&) {
  // Layer 1 of pair (i, k), to the grid: W_f f_i + b - W_o offset_i + W_o bits_k; from it: W_c f_cell + W_p f_i + b +
  // W_o offset_i - W_o bits_k. Both networks' parts of a particle are made at once.
  const int64_t n = graph_.particles, pairs = corners * n, cells = graph_.level[0].cells;
  const DeviceFcn &to = network_.fcn("particle_to_grid"), &from = network_.fcn("grid_to_particle");
  float *const to_particle = memory_.rows32(n), *const from_particle = memory_.rows32(n);
  project({.rows = n,
           .row_count = graph_.particle_count,
           .x = particles_.f16,
           .weight = {network_.tile("particle_to_grid", 0), network_.tile("grid_to_particle", h)},
           .bias = {to.b1, from.b1},
           .offset = graph_.offset,
           .offset_weight = {to.w1 + h, from.w1 + 2 * h},
           .offset_stride = {to.inputs, from.inputs},
           .offset_sign = {-1, 1},
           .out = {to_particle, from_particle}},
          stream_);
  FusedMlp to_grid = network_.network("particle_to_grid", pairs, graph_.pair_count);
  to_grid.table[0] = {to_particle, by_particle};
  to_grid.table[1] = {network_.table("particle_to_grid"), by_corner};
  to_grid.out16 = memory_.rows16(pairs);
  to_particle_ = network_.network("grid_to_particle", pairs, graph_.pair_count);
  to_particle_.table[0] = {from_particle, by_particle};
  to_particle_.table[1] = {network_.table("grid_to_particle"), by_corner};
  forward(to_grid, stream_);
  const RowLatents sums = latents(cells);
  sum_segments({.segments = cells,
                .row_count = graph_.level[0].cell_count,
                .begin = graph_.pair_begin,
                .item = graph_.pair,
                .are_long = true,
                .source = to_grid.out16,
                .weight = graph_.weight,
                .scale = static_cast<float>(network_.config().p2g_scale),
                .out32 = sums.f32,
                .out16 = sums.f16},
               stream_);
  f_[0] = sums;
}

void ForwardPass::grid_to_particle(const PlanBlock&) {
  const int64_t n = graph_.particles, n_cells = graph_.level[0].cells;
  float* const per_cell = memory_.rows32(n_cells);
  project({.rows = n_cells,
           .row_count = graph_.level[0].cell_count,
           .x = f_[0].f16,
           .weight = {network_.tile("grid_to_particle", 0)},
           .out = {per_cell}},
          stream_);
  FusedMlp& network = to_particle_;
  network.table[2] = {per_cell, {graph_.cell}};
  float* const sums = memory_.rows32(n);
  network.group_weight = graph_.weight;
  network.group_add32 = particles_.f32;
  network.group32 = sums;
  forward(network, stream_);
  result_ = sums;
}

void ForwardPass::restrict_to_coarse(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const std::string& name = block.name;
  FusedMlp network = network_.network(name, level.cells, level.cell_count);
  network.operand[0] = {.rows = f_[l].f16, .weight = network_.tile(name, 0)};
  network.table[0] = {network_.table(name), {level.octant}};
  network.out16 = memory_.rows16(level.cells);
  forward(network, stream_);
  const int64_t parents = graph_.level[l + 1].cells;
  const RowLatents coarse = latents(parents);
  sum_segments({.segments = parents,
                .row_count = graph_.level[l + 1].cell_count,
                .begin = level.child_begin,
                .first = level.first_child,
                .item = level.child,
                .source = network.out16,
                .out32 = coarse.f32,
                .out16 = coarse.f16},
               stream_);
  f_[l + 1] = coarse;
}

void ForwardPass::prolong_to_fine(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const RowLatents refined = latents(level.cells);
  FusedMlp network = prolongation(network_, l, level, f_[l + 1], f_[l], refined);
  if (can_project_ahead()) {
    ahead_ = projections(level);
    network.epilogue = epilogue(numbered(network_.plan().blocks[block.number + 1].name, 0, ".edge"), ahead_);
  }
  forward(network, stream_);
  f_[l] = refined;
}

void ForwardPass::pass_messages(const PlanBlock& block) {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e; e is the unit vector at first, the edge latent after.
  const LevelLinks& level = graph_.level[block.level()];
  RowLatents nodes = f_[block.level()];
  std::vector<IterationRows> all;  // of two block.iterations in turn
  const auto rows_of = [&](int64_t k) -> IterationRows& {
    const auto place = static_cast<std::size_t>(k % 2);
    if (place == all.size())
      all.push_back(
          {projections(level), memory_.rows16(level.edges), memory_.rows16(level.edges), latents(level.cells)});
    return all[place];
  };
  uint16_t* latent = nullptr;
  Projections projected = std::exchange(ahead_, {});
  for (int64_t k = 0; k < block.iterations; ++k) {
    const std::string edge_name = numbered(block.name, k, ".edge");
    const std::string cell_name = numbered(block.name, k, ".cell");
    const IterationRows own = rows_of(k);
    if (projected.sender == nullptr) {
      projected = own.projections;
      const EpilogueProjection wanted = epilogue(edge_name, projected);
      project({.rows = level.cells,
               .row_count = level.cell_count,
               .x = nodes.f16,
               .weight = {wanted.weight[0], wanted.weight[1]},
               .bias = {wanted.bias[0], wanted.bias[1]},
               .out = {wanted.out[0], wanted.out[1]}},
              stream_);
    }
    FusedMlp edge = network_.network(edge_name, level.edges, level.edge_count);
    edge.table[0] = {projected.sender, {level.sender}};
    edge.table[1] = {projected.receiver, {level.receiver}};
    edge.out16 = own.message;
    uint16_t* next_latent = edge.out16;
    if (k == 0) {
      edge.table[2] = {network_.table(edge_name), {level.slot}};
    } else {
      edge.operand[0] = {.rows = latent, .weight = network_.tile(edge_name, 2 * h)};
      if (k + 1 < block.iterations) {
        next_latent = own.latent;
        edge.add16 = latent;
        edge.sum16 = next_latent;
      }
    }
    forward(edge, stream_);
    latent = next_latent;

    FusedMlp cell = network_.network(cell_name, level.cells, level.cell_count);
    cell.operand[0] = {.rows = edge.out16,
                       .begin = level.edge_begin,
                       .first = level.first_edge,
                       .weight = network_.tile(cell_name, 0)};
    cell.operand[1] = {.rows = nodes.f16, .weight = network_.tile(cell_name, h)};
    cell.table[0] = {network_.fcn(cell_name).b1, always_first};
    cell.add32 = nodes.f32;
    cell.sum32 = own.nodes.f32;
    cell.copy16 = own.nodes.f16;
    projected = {};
    if (can_project_ahead() && k + 1 < block.iterations) {
      projected = rows_of(k + 1).projections;
      cell.epilogue = epilogue(numbered(block.name, k + 1, ".edge"), projected);
    }
    forward(cell, stream_);
    nodes = own.nodes;
  }
  f_[block.level()] = nodes;
}

}  // namespace

float* forward_to_decoder(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, void* stream,
                          const std::function<void()>& grid_ready) {
  return ForwardPass(network, graph, memory, stream).run(grid_ready);
}

}  // namespace graupel::graph
