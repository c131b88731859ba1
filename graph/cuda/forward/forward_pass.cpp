#include "graph/cuda/forward/forward_pass.h"

#include "core/system/error.h"

namespace graupel::graph {

ForwardPass::ForwardPass(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, void* stream)
    : network_(network), graph_(graph), memory_(memory), stream_(stream), f_(graph.level.size()) {
  for (const PlanBlock& block : network.plan().blocks) GRAUPEL_ASSERT(block.level() < f_.size());
}

void ForwardPass::encode_particles(FusedMlp& encoder, const int32_t* row_count) {
  const int64_t n = graph_.particles;
  const LayerPlan& plan = network_.plan();
  const std::string& name = plan.layers.front().name;
  const DeviceFcn& fcn = network_.fcn(name);
  float* const first = memory_.rows32(n);
  encode_features({.rows = n,
                   .features = graph_.features,
                   .width = static_cast<int>(plan.values.front().width),
                   .w1 = fcn.w1,
                   .stride = fcn.inputs,
                   .type_row = graph_.type_row,
                   .type_table = network_.table(name),
                   .out = first},
                  stream_);
  particles_ = latents(n);
  encoder = network_.network(name, n, row_count);
  encoder.table[0] = {first, {}};
  encoder.sum32 = particles_.f32;
  encoder.copy16 = particles_.f16;
  forward(encoder, stream_);
}

Projections ForwardPass::rows_for(const PlanLayer& gather, int64_t rows, const PlanLayer& other) {
  Projections to;
  for (int j = 0; j < 2; ++j)
    if ((j == 0 ? gather : other).is_linear())
      to.out16[j] = memory_.rows16(rows);
    else
      to.out[j] = memory_.rows32(rows);
  return to;
}

Projections ForwardPass::node_projections(const PlanLayer& gather, int64_t rows) {
  return node_projections(gather, rows_for(gather, rows, gather));
}

Projections ForwardPass::node_projections(const PlanLayer& gather, const Projections& taken) const {
  Projections wanted = taken;
  wanted.weight[0] = network_.tile(gather.name, 0);
  wanted.weight[1] = network_.tile(gather.name, h);
  wanted.bias[1] = network_.fcn(gather.name).b1;
  return wanted;
}

void ForwardPass::project_nodes(const Projections& wanted, const LevelLinks& level, const uint16_t* nodes) {
  project({.rows = level.cells, .row_count = level.cell_count, .x = nodes, .to = wanted}, stream_);
}

Projections ForwardPass::project_particles() {
  // Before the activation of pair (p, k), to the grid: W_f f_p + b - W_o offset_p + W_o bits_k; from it: W_c f_cell +
  // W_p f_p + b + W_o offset_p - W_o bits_k.
  const std::vector<PlanBlock>& blocks = network_.plan().blocks;
  const PlanLayer &to_layer = *layers(blocks.front()).gather, &from_layer = *layers(blocks.back()).gather;
  const DeviceFcn &to = network_.fcn(to_layer.name), &from = network_.fcn(from_layer.name);
  Projections made = rows_for(to_layer, graph_.particles, from_layer);
  made.weight[0] = network_.tile(to_layer.name, 0);
  made.weight[1] = network_.tile(from_layer.name, h);
  made.bias[0] = to.b1;
  made.bias[1] = from.b1;
  project({.rows = graph_.particles,
           .row_count = graph_.particle_count,
           .x = particles_.f16,
           .to = made,
           .offset = graph_.offset,
           .offset_weight = {to.w1 + h, from.w1 + 2 * h},
           .offset_stride = {to.inputs, from.inputs},
           .offset_sign = {-1, 1}},
          stream_);
  return made;
}

FusedMlp ForwardPass::update(const PlanLayer& layer, int64_t rows, const int32_t* row_count, RowOperand sum,
                             const RowLatents& nodes, const RowLatents& result) const {
  FusedMlp network = network_.network(layer.name, rows, row_count);
  sum.weight = network_.tile(layer.name, 0);
  network.operand[0] = sum;
  if (nodes.f16) network.operand[1] = {.rows = nodes.f16, .weight = network_.tile(layer.name, h)};
  network.table[0] = {network_.fcn(layer.name).b1, always_first};
  network.add32 = nodes.f32;
  network.sum32 = result.f32;
  network.copy16 = result.f16;
  return network;
}

FusedMlp ForwardPass::prolong(const PlanBlock& block) {
  const std::size_t l = block.level();
  const LevelLinks& level = graph_.level[l];
  const PlanLayer& layer = *layers(block).gather;
  const RowLatents refined = latents(level.cells);
  FusedMlp network =
      update(layer, level.cells, level.cell_count, {.rows = f_[l + 1].f16, .index = level.parent}, f_[l], refined);
  network.table[0] = {network_.table(layer.name), {level.octant}};
  if (can_project_ahead()) {
    ahead_ = node_projections(*layers(network_.plan().blocks[block.number + 1]).gather, level.cells);
    network.epilogue = ahead_;
  }
  forward(network, stream_);
  f_[l] = refined;
  return network;
}

}  // namespace graupel::graph
