#include "train/networks/cuda/fused_aggregation.h"

#include "graph/plan/plan_walk.h"

namespace graupel::train {

namespace {

/// Pair q belongs to particle q / 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};

}  // namespace

/// From the gradient of the particles' latents before the decoder, block by block, to that of the encoder's result.
class FusedAggregation::BackwardPass {
 public:
  BackwardPass(FusedAggregation& network, const DeviceBatch& batch, float* grad_particles)
      : network_(network), batch_(batch), g_(grad_particles), skip_(batch.level.size()) {}

  float* run() {
    graph::run_blocks_in_reverse(network_.packed_.plan(), *this);
    return g_;
  }

  void grid_to_particle(const graph::PlanBlock& block);
  void pass_messages(const graph::PlanBlock& block);
  void prolong_to_fine(const graph::PlanBlock& block);
  void restrict_to_coarse(const graph::PlanBlock& block);
  void particle_to_grid(const graph::PlanBlock& block);

 private:
  const graph::AggregationRecord::Step& step_of(const graph::PlanBlock& block) const {
    return network_.record_.blocks[block.number].front();
  }

  FusedAggregation& network_;
  const DeviceBatch& batch_;
  float* g_;                            ///< gradient of what the block at hand made
  std::vector<float*> skip_;            ///< gradient of level l's cells through the up pass
  float* beside_cells_ = nullptr;       ///< of the particles' latents beside the cells
  const uint16_t* received_ = nullptr;  ///< of what grid_to_particle's gather layer takes of the particles
};

graph::RowLatents FusedAggregation::to_decoder(const graph::NetworkGraph& graph) {
  return graph::forward_aggregation(packed_, graph, *this, record_, nullptr);
}

float* FusedAggregation::back_to_encoder(const DeviceBatch& batch, float* grad_particles) {
  return BackwardPass(*this, batch, grad_particles).run();
}

const uint16_t* FusedAggregation::update_backward(const std::string& name, const graph::FusedMlp& network,
                                                  const float* g, float* nodes) {
  const Fcn& net = fcn(name);
  const bool has_nodes = network.operand[1].rows != nullptr;
  uint16_t* const sum = rows16(network.rows);
  graph::FusedMlpGradient way{.network = network, .g32 = g};
  way.operand[0] = {.d16 = sum};
  if (has_nodes) way.operand[1] = {.add32 = g, .d32 = nodes};
  way = back_through(name, way);
  add_product(network.rows, way.d_sum, network.operand[0].rows, net.w1_grad, 0, h, net.b1_grad);
  if (has_nodes) add_product(network.rows, way.d_sum, network.operand[1].rows, net.w1_grad, h, h);
  return sum;
}

void FusedAggregation::BackwardPass::grid_to_particle(const graph::PlanBlock& block) {
  beside_cells_ = network_.rows32(batch_.particles);
  const std::string name = block.name + ".gather";
  const Fcn::Layer& layer = network_.gather(name);
  const int64_t n = batch_.particles, cells = batch_.level[0].cells;
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = network_.update_backward(block.name, step.network, g_, beside_cells_);
  uint16_t *const of_particles = network_.rows16(n), *const of_cells = network_.rows16(cells);
  network_.offsets_backward(layer.w_grad, graph::ActivationGradient{.nodes = n,
                                                                    .items = {.fixed = corners},
                                                                    .g = sum,
                                                                    .is_receiver = true,
                                                                    .weight = f32(batch_.weight),
                                                                    .signs = step.signs,
                                                                    .out = of_particles,
                                                                    .corner_sign = -1,
                                                                    .offset = f32(batch_.offset)});
  graph::sum_gradients(
      graph::ActivationGradient{
          .nodes = cells,
          .items = {.begin = index(batch_.pair_begin), .item = index(batch_.pair), .are_long = true},
          .g = sum,
          .row = by_particle,
          .weight = f32(batch_.weight),
          .signs = step.signs,
          .out = of_cells},
      nullptr);
  network_.add_product(n, of_particles, network_.record_.particles.f16, layer.w_grad, h, h, layer.b_grad);
  network_.add_product(cells, of_cells, step.gathered, layer.w_grad, 0, h);
  float* const grad = network_.rows32(cells);
  graph::project_back(
      {.rows = cells, .d = {{.rows = of_cells, .weight = network_.packed_.tile(name, 0)}}, .sum32 = grad}, nullptr);
  received_ = of_particles;
  g_ = grad;
}

void FusedAggregation::BackwardPass::particle_to_grid(const graph::PlanBlock& block) {
  const std::string name = block.name + ".gather";
  const Fcn::Layer& layer = network_.gather(name);
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = network_.update_backward(block.name, step.network, g_);
  uint16_t* const sent = network_.rows16(batch_.particles);
  network_.offsets_backward(layer.w_grad,
                            graph::ActivationGradient{.nodes = batch_.particles,
                                                      .items = {.fixed = corners},
                                                      .g = sum,
                                                      .row = {index(batch_.cell)},
                                                      .weight = f32(batch_.weight),
                                                      .scale = static_cast<float>(network_.config_.p2g_scale),
                                                      .signs = step.signs,
                                                      .out = sent,
                                                      .corner_sign = 1,
                                                      .offset = f32(batch_.offset)});
  network_.add_product(batch_.particles, sent, network_.record_.particles.f16, layer.w_grad, 0, h, layer.b_grad);
  float* const grad = network_.rows32(batch_.particles);
  graph::project_back({.rows = batch_.particles,
                       .d = {{.rows = received_, .weight = network_.packed_.tile("grid_to_particle.gather", h)},
                             {.rows = sent, .weight = network_.packed_.tile(name, 0)}},
                       .add32 = beside_cells_,
                       .sum32 = grad},
                      nullptr);
  g_ = grad;
}

void FusedAggregation::BackwardPass::restrict_to_coarse(const graph::PlanBlock& block) {
  const DeviceLevel& fine = batch_.level[block.level()];
  const std::string gather_name = block.name + ".gather";
  const Fcn::Layer& layer = network_.gather(gather_name);
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = network_.update_backward(block.name, step.network, g_);
  uint16_t* const sent = network_.rows16(fine.cells);
  network_.offsets_backward(layer.w_grad, graph::ActivationGradient{.nodes = fine.cells,
                                                                    .items = {.fixed = 1},
                                                                    .g = sum,
                                                                    .row = {index(fine.parent)},
                                                                    .signs = step.signs,
                                                                    .out = sent,
                                                                    .offsets = graph::Offsets::octant,
                                                                    .octant = index(fine.octant)});
  network_.add_product(fine.cells, sent, step.gathered, layer.w_grad, 0, h, layer.b_grad);
  float* const grad = network_.rows32(fine.cells);
  graph::project_back({.rows = fine.cells,
                       .d = {{.rows = sent, .weight = network_.packed_.tile(gather_name, 0)}},
                       .add32 = skip_[block.level()],
                       .sum32 = grad},
                      nullptr);
  g_ = grad;
}

void FusedAggregation::BackwardPass::prolong_to_fine(const graph::PlanBlock& block) {
  const std::size_t l = block.level();
  skip_[l] = network_.rows32(batch_.level[l].cells);
  g_ = network_.prolong_backward(l, step_of(block).network, batch_, g_, skip_[l]);
}

void FusedAggregation::BackwardPass::pass_messages(const graph::PlanBlock& block) {
  const DeviceLevel& level = batch_.level[block.level()];
  for (int64_t k = block.iterations; k-- > 0;) {
    const std::string at_k = block.name + "." + std::to_string(k), name = at_k + ".gather";
    const Fcn::Layer& layer = network_.gather(name);
    const graph::AggregationRecord::Step& step = network_.record_.blocks[block.number][static_cast<std::size_t>(k)];
    float* const beside_sums = network_.rows32(level.cells);
    const uint16_t* const sum = network_.update_backward(at_k + ".cell", step.network, g_, beside_sums);
    uint16_t *const sent = network_.rows16(level.cells), *const received = network_.rows16(level.cells);
    network_.offsets_backward(layer.w_grad, graph::EdgeGradient{.cells = level.cells,
                                                                .edge_begin = index(level.edge_begin),
                                                                .sender = index(level.sender),
                                                                .slot = index(level.slot),
                                                                .reverse = index(level.reverse),
                                                                .g = sum,
                                                                .signs = step.signs,
                                                                .sent = sent,
                                                                .received = received});
    const uint16_t* const nodes = step.gathered;
    network_.add_product(level.cells, sent, nodes, layer.w_grad, 0, h);
    network_.add_product(level.cells, received, nodes, layer.w_grad, h, h, layer.b_grad);
    float* const before = network_.rows32(level.cells);
    graph::project_back({.rows = level.cells,
                         .d = {{.rows = sent, .weight = network_.packed_.tile(name, 0)},
                               {.rows = received, .weight = network_.packed_.tile(name, h)}},
                         .add32 = beside_sums,
                         .sum32 = before},
                        nullptr);
    g_ = before;
  }
}

}  // namespace graupel::train
