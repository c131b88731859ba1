#include "graph/cuda/forward/aggregation_forward.h"

#include "core/system/error.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

constexpr int corners = 8;
constexpr int64_t h = layer_width;

/// Pair q belongs to particle q / 8 and corner q % 8.
constexpr RowOf by_particle{nullptr, 3, -1};
constexpr RowOf by_corner{nullptr, 0, corners - 1};
constexpr RowOf always_first{nullptr, 0, 0};

/// W_s f_s, and W_r f_r with the bias, of a gather layer.
struct Projections {
  uint16_t *sender = nullptr, *receiver = nullptr;
};

class ForwardPass {
 public:
  ForwardPass(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, AggregationRecord& record,
              void* stream)
      : network_(network), graph_(graph), memory_(memory), record_(record), stream_(stream), f_(graph.level.size()) {
    GRAUPEL_ASSERT(f_.size() == static_cast<std::size_t>(network.config().levels));
  }

  RowLatents run() {
    record_ = {};
    record_.blocks.resize(network_.plan().blocks.size());
    record_.particles = encode_particles(network_, graph_, memory_, record_.encoder, stream_);
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
  uint8_t* signs(int64_t items) {
    constexpr int64_t in_a_row = 2 * h / sign_bytes;
    return reinterpret_cast<uint8_t*>(memory_.rows16((items + in_a_row - 1) / in_a_row));
  }
  AggregationRecord::Step& new_step(const PlanBlock& block) { return record_.blocks[block.number].emplace_back(); }
  /// FCN `name` over [sum] or, with `nodes`, over [sum, nodes]; the nodes are added to its result.
  RowLatents update(const std::string& name, int64_t rows, const uint16_t* sum, const RowLatents& nodes,
                    FusedMlp& record, const EpilogueProjection& epilogue = {});
  EpilogueProjection epilogue(const std::string& gather, const Projections& to) const;
  Projections projections(const LevelLinks& level) {
    return {memory_.rows16(level.cells), memory_.rows16(level.cells)};
  }

  const PackedHgn& network_;
  const HgnGraph& graph_;
  RowMemory& memory_;
  AggregationRecord& record_;
  void* stream_;
  std::vector<RowLatents> f_;        ///< cells of each level
  RowLatents result_;                ///< of the particles
  Projections ahead_;                ///< of the next block's first iteration, where they are there already
  uint16_t* to_particle_ = nullptr;  ///< W_p f_p + W_o offset + b of grid_to_particle.gather, [particles, 128]
};

EpilogueProjection ForwardPass::epilogue(const std::string& gather, const Projections& to) const {
  EpilogueProjection wanted;
  wanted.weight[0] = network_.tile(gather, 0);
  wanted.weight[1] = network_.tile(gather, h);
  wanted.bias[1] = network_.fcn(gather).b1;
  wanted.out16[0] = to.sender;
  wanted.out16[1] = to.receiver;
  return wanted;
}

RowLatents ForwardPass::update(const std::string& name, int64_t rows, const uint16_t* sum, const RowLatents& nodes,
                               FusedMlp& record, const EpilogueProjection& epilogue) {
  const RowLatents result = latents(rows);
  record = network_.network(name, rows);
  record.operand[0] = {.rows = sum, .weight = network_.tile(name, 0)};
  if (nodes.f16) record.operand[1] = {.rows = nodes.f16, .weight = network_.tile(name, h)};
  record.table[0] = {network_.fcn(name).b1, always_first};
  record.add32 = nodes.f32;
  record.sum32 = result.f32;
  record.copy16 = result.f16;
  record.epilogue = epilogue;
  forward(record, stream_);
  return result;
}

void ForwardPass::particle_to_grid(const PlanBlock& block) {
  // Before the activation of pair (p, k), to the grid: W_f f_p + b - W_o offset_p + W_o bits_k; from it: W_c f_cell +
  // W_p f_p + b + W_o offset_p - W_o bits_k. Both parts of a particle are made at once.
  const std::string to_name = "particle_to_grid.gather", from_name = "grid_to_particle.gather";
  const int64_t n = graph_.particles, cells = graph_.level[0].cells;
  const DeviceFcn &to = network_.fcn(to_name), &from = network_.fcn(from_name);
  uint16_t* const to_cells = memory_.rows16(n);
  to_particle_ = memory_.rows16(n);
  project({.rows = n,
           .x = record_.particles.f16,
           .weight = {network_.tile(to_name, 0), network_.tile(from_name, h)},
           .bias = {to.b1, from.b1},
           .offset = graph_.offset,
           .offset_weight = {to.w1 + h, from.w1 + 2 * h},
           .offset_stride = {to.inputs, from.inputs},
           .offset_sign = {-1, 1},
           .out16 = {to_cells, to_particle_}},
          stream_);
  uint16_t* const sum = memory_.rows16(cells);
  AggregationRecord::Step& step = new_step(block);
  step.signs = signs(corners * n);
  aggregate_activations({.receivers = cells,
                         .items = {.begin = graph_.pair_begin, .item = graph_.pair, .are_long = true},
                         .sender = by_particle,
                         .sent = to_cells,
                         .table = network_.table(to_name),
                         .table_row = by_corner,
                         .weight = graph_.weight,
                         .scale = static_cast<float>(network_.config().p2g_scale),
                         .sum = sum,
                         .signs = step.signs},
                        stream_);
  f_[0] = update(block.name, cells, sum, {}, step.network);
}

void ForwardPass::grid_to_particle(const PlanBlock& block) {
  const std::string name = "grid_to_particle.gather";
  const int64_t n = graph_.particles, n_cells = graph_.level[0].cells;
  uint16_t *const per_cell = memory_.rows16(n_cells), *const sum = memory_.rows16(n);
  project({.rows = n_cells, .x = f_[0].f16, .weight = {network_.tile(name, 0)}, .out16 = {per_cell}}, stream_);
  AggregationRecord::Step& step = new_step(block);
  step.gathered = f_[0].f16;
  step.signs = signs(corners * n);
  aggregate_activations({.receivers = n,
                         .items = {.fixed = corners},
                         .sender = {graph_.cell},
                         .sent = per_cell,
                         .received = to_particle_,
                         .table = network_.table(name),
                         .table_row = by_corner,
                         .weight = graph_.weight,
                         .sum = sum,
                         .signs = step.signs},
                        stream_);
  result_ = update(block.name, n, sum, record_.particles, step.network);
}

void ForwardPass::restrict_to_coarse(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const std::string gather = block.name + ".gather";
  const int64_t parents = graph_.level[l + 1].cells;
  uint16_t *const per_child = memory_.rows16(level.cells), *const sum = memory_.rows16(parents);
  project({.rows = level.cells, .x = f_[l].f16, .weight = {network_.tile(gather, 0)}, .out16 = {per_child}}, stream_);
  AggregationRecord::Step& step = new_step(block);
  step.signs = signs(level.cells);
  step.gathered = f_[l].f16;
  aggregate_activations({.receivers = parents,
                         .items = {.begin = level.child_begin, .first = level.first_child, .item = level.child},
                         .sent = per_child,
                         .table = network_.table(gather),
                         .table_row = {level.octant},
                         .sum = sum,
                         .signs = step.signs},
                        stream_);
  f_[l + 1] = update(block.name, parents, sum, {}, step.network);
}

void ForwardPass::prolong_to_fine(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const RowLatents refined = latents(level.cells);
  FusedMlp& network = new_step(block).network;
  network = prolongation(network_, l, level, f_[l + 1], f_[l], refined);
  if (can_project_ahead()) {
    ahead_ = projections(level);
    network.epilogue = epilogue(numbered(network_.plan().blocks[block.number + 1].name, 0, ".gather"), ahead_);
  }
  forward(network, stream_);
  f_[l] = refined;
}

void ForwardPass::pass_messages(const PlanBlock& block) {
  // Before the activation of edge s -> r: W_s f_s + W_r f_r + b + W_o (unit vector from s to r).
  const LevelLinks& level = graph_.level[block.level()];
  RowLatents& nodes = f_[block.level()];
  Projections projected = std::exchange(ahead_, {});
  record_.blocks[block.number].reserve(static_cast<std::size_t>(block.iterations));
  for (int64_t k = 0; k < block.iterations; ++k) {
    const std::string gather = numbered(block.name, k, ".gather");
    AggregationRecord::Step& step = new_step(block);
    step.gathered = nodes.f16;
    if (projected.sender == nullptr) {
      projected = projections(level);
      const EpilogueProjection wanted = epilogue(gather, projected);
      project({.rows = level.cells,
               .x = nodes.f16,
               .weight = {wanted.weight[0], wanted.weight[1]},
               .bias = {wanted.bias[0], wanted.bias[1]},
               .out16 = {wanted.out16[0], wanted.out16[1]}},
              stream_);
    }
    uint16_t* const sum = memory_.rows16(level.cells);
    step.signs = signs(level.edges);
    aggregate_activations({.receivers = level.cells,
                           .items = {.begin = level.edge_begin, .first = level.first_edge},
                           .sender = {level.sender},
                           .sent = projected.sender,
                           .received = projected.receiver,
                           .table = network_.table(gather),
                           .table_row = {level.slot},
                           .sum = sum,
                           .signs = step.signs},
                          stream_);
    EpilogueProjection next;
    projected = {};
    if (can_project_ahead() && k + 1 < block.iterations) {
      projected = projections(level);
      next = epilogue(numbered(block.name, k + 1, ".gather"), projected);
    }
    nodes = update(numbered(block.name, k, ".cell"), level.cells, sum, nodes, step.network, next);
  }
}

}  // namespace

RowLatents forward_aggregation(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory,
                               AggregationRecord& record, void* stream) {
  return ForwardPass(network, graph, memory, record, stream).run();
}

}  // namespace graupel::graph
