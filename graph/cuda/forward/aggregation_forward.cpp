#include "graph/cuda/forward/aggregation_forward.h"

#include "graph/cuda/forward/forward_pass.h"

namespace graupel::graph {

namespace {

class AggregationPass : public ForwardPass {
 public:
  AggregationPass(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, AggregationRecord& record,
                  void* stream)
      : ForwardPass(network, graph, memory, stream), record_(record) {}

  RowLatents run() {
    record_ = {};
    record_.blocks.resize(network_.plan().blocks.size());
    encode_particles(record_.encoder);
    record_.particles = particles_;
    run_blocks(network_.plan(), *this);
    return result_;
  }

  void particle_to_grid(const PlanBlock& block);
  void pass_messages(const PlanBlock& block);
  void restrict_to_coarse(const PlanBlock& block);
  void prolong_to_fine(const PlanBlock& block) { new_step(block).network = prolong(block); }
  void grid_to_particle(const PlanBlock& block);

 private:
  AggregationRecord::Step& new_step(const PlanBlock& block) { return record_.blocks[block.number].emplace_back(); }
  /// Sums the activations of `items` items; leaves their signs.
  const uint16_t* aggregate(AggregationRecord::Step& step, int64_t items, ActivationAggregation sums);
  /// W f, of the senders of a transfer.
  const uint16_t* project_senders(const PlanLayer& gather, int64_t rows, const uint16_t* f);
  RowLatents finish(AggregationRecord::Step& step, const PlanLayer& layer, int64_t rows, const uint16_t* sum,
                    const RowLatents& nodes, const Projections& epilogue = {});

  AggregationRecord& record_;
  RowLatents result_;                      ///< of the particles
  const uint16_t* to_particle_ = nullptr;  ///< W_p f_p + W_o offset + b of grid_to_particle.gather, [particles, 128]
};

const uint16_t* AggregationPass::aggregate(AggregationRecord::Step& step, int64_t items, ActivationAggregation sums) {
  constexpr int64_t in_a_row = 2 * h / sign_bytes;
  sums.sum = memory_.rows16(sums.receivers);
  sums.signs = step.signs = reinterpret_cast<uint8_t*>(memory_.rows16((items + in_a_row - 1) / in_a_row));
  aggregate_activations(sums, stream_);
  return sums.sum;
}

const uint16_t* AggregationPass::project_senders(const PlanLayer& gather, int64_t rows, const uint16_t* f) {
  uint16_t* const sent = memory_.rows16(rows);
  project({.rows = rows, .x = f, .to = {.weight = {network_.tile(gather.name, 0)}, .out16 = {sent}}}, stream_);
  return sent;
}

/// The update behind a sum.
RowLatents AggregationPass::finish(AggregationRecord::Step& step, const PlanLayer& layer, int64_t rows,
                                   const uint16_t* sum, const RowLatents& nodes, const Projections& epilogue) {
  const RowLatents result = latents(rows);
  step.network = update(layer, rows, nullptr, {.rows = sum}, nodes, result);
  step.network.epilogue = epilogue;
  forward(step.network, stream_);
  return result;
}

void AggregationPass::particle_to_grid(const PlanBlock& block) {
  const int64_t n = graph_.particles, cells = graph_.level[0].cells;
  const BlockLayers layer = layers(block);
  const Projections of_particles = project_particles();
  to_particle_ = of_particles.out16[1];
  AggregationRecord::Step& step = new_step(block);
  const uint16_t* const sum = aggregate(step, corners * n,
                                        {.receivers = cells,
                                         .items = {.begin = graph_.pair_begin, .item = graph_.pair, .are_long = true},
                                         .sender = by_particle,
                                         .sent = of_particles.out16[0],
                                         .table = network_.table(layer.gather->name),
                                         .table_row = by_corner,
                                         .weight = graph_.weight,
                                         .scale = static_cast<float>(network_.plan().scale_of(block))});
  f_[0] = finish(step, *layer.update, cells, sum, {});
}

void AggregationPass::grid_to_particle(const PlanBlock& block) {
  const int64_t n = graph_.particles;
  const BlockLayers layer = layers(block);
  AggregationRecord::Step& step = new_step(block);
  step.gathered = f_[0].f16;
  const uint16_t* const sum = aggregate(step, corners * n,
                                        {.receivers = n,
                                         .items = {.fixed = corners},
                                         .sender = {graph_.cell},
                                         .sent = project_senders(*layer.gather, graph_.level[0].cells, f_[0].f16),
                                         .received = to_particle_,
                                         .table = network_.table(layer.gather->name),
                                         .table_row = by_corner,
                                         .weight = graph_.weight});
  result_ = finish(step, *layer.update, n, sum, particles_);
}

void AggregationPass::restrict_to_coarse(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const int64_t parents = graph_.level[l + 1].cells;
  const BlockLayers layer = layers(block);
  AggregationRecord::Step& step = new_step(block);
  step.gathered = f_[l].f16;
  const uint16_t* const sum =
      aggregate(step, level.cells,
                {.receivers = parents,
                 .items = {.begin = level.child_begin, .first = level.first_child, .item = level.child},
                 .sent = project_senders(*layer.gather, level.cells, f_[l].f16),
                 .table = network_.table(layer.gather->name),
                 .table_row = {level.octant}});
  f_[l + 1] = finish(step, *layer.update, parents, sum, {});
}

void AggregationPass::pass_messages(const PlanBlock& block) {
  // Before the activation of edge s -> r: W_s f_s + W_r f_r + b + W_o (unit vector from s to r).
  const LevelLinks& level = graph_.level[block.level()];
  RowLatents& nodes = f_[block.level()];
  Projections projected = std::exchange(ahead_, {});
  record_.blocks[block.number].reserve(static_cast<std::size_t>(block.iterations));
  for (int64_t k = 0; k < block.iterations; ++k) {
    const BlockLayers layer = layers(block, k);
    AggregationRecord::Step& step = new_step(block);
    step.gathered = nodes.f16;
    if (projected.weight[0] == nullptr) {
      projected = node_projections(*layer.gather, level.cells);
      project_nodes(projected, level, nodes.f16);
    }
    const uint16_t* const sum = aggregate(step, level.edges,
                                          {.receivers = level.cells,
                                           .items = {.begin = level.edge_begin, .first = level.first_edge},
                                           .sender = {level.sender},
                                           .sent = projected.out16[0],
                                           .received = projected.out16[1],
                                           .table = network_.table(layer.gather->name),
                                           .table_row = {level.slot}});
    projected = {};
    if (can_project_ahead() && k + 1 < block.iterations)
      projected = node_projections(*layers(block, k + 1).gather, level.cells);
    nodes = finish(step, *layer.update, level.cells, sum, nodes, projected);
  }
}

}  // namespace

RowLatents forward_aggregation(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory,
                               AggregationRecord& record, void* stream) {
  return AggregationPass(network, graph, memory, record, stream).run();
}

}  // namespace graupel::graph
