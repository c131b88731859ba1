#include "train/networks/cuda/fused_aggregation.h"

namespace graupel::train {

namespace {

/// Pair q belongs to particle q / 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};

}  // namespace

graph::RowLatents FusedSums::to_decoder(const graph::HgnGraph& graph) {
  return graph::forward_sums(packed_, graph, *this, record_, nullptr);
}

float* FusedSums::back_to_encoder(const DeviceBatch& batch, float* grad_particles) {
  const auto levels = static_cast<std::size_t>(config_.levels);
  float* const beside_cells = rows32(batch.particles);
  const uint16_t* received = nullptr;
  float* g = grid_to_particle_backward(batch, grad_particles, &received, beside_cells);
  std::vector<float*> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    g = pass_messages_backward("up." + std::to_string(l), record_.up[l], batch.level[l], g);
    skip[l] = rows32(batch.level[l].cells);
    g = prolong_backward(l, record_.prolongation[l], batch, g, skip[l]);
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward("down." + std::to_string(l), record_.down[l], batch.level[l], g);
    if (l > 0) g = restrict_backward(l - 1, batch, g, skip[l - 1]);
  }
  const uint16_t* const sent = particle_to_grid_backward(batch, g);
  float* const grad = rows32(batch.particles);
  graph::project_back({.rows = batch.particles,
                       .d = {{.rows = received, .weight = packed_.tile("grid_to_particle.gather", h)},
                             {.rows = sent, .weight = packed_.tile("particle_to_grid.gather", 0)}},
                       .add32 = beside_cells,
                       .sum32 = grad},
                      nullptr);
  return grad;
}

const uint16_t* FusedSums::update_backward(const std::string& name, const graph::RowNetwork& network, const float* g,
                                           float* nodes) {
  const Fcn& net = fcn(name);
  const bool has_nodes = network.operand[1].rows != nullptr;
  uint16_t* const sum = rows16(network.rows);
  graph::RowNetworkGradient way{.network = network, .g32 = g};
  way.operand[0] = {.d16 = sum};
  if (has_nodes) way.operand[1] = {.add32 = g, .d32 = nodes};
  way = back_through(name, way);
  add_product(network.rows, way.d_sum, network.operand[0].rows, net.w1_grad, 0, h, net.b1_grad);
  if (has_nodes) add_product(network.rows, way.d_sum, network.operand[1].rows, net.w1_grad, h, h);
  return sum;
}

float* FusedSums::grid_to_particle_backward(const DeviceBatch& batch, const float* g, const uint16_t** received,
                                            float* nodes) {
  const std::string name = "grid_to_particle.gather";
  const Fcn::Layer& layer = gather(name);
  const int64_t n = batch.particles, cells = batch.level[0].cells;
  const graph::SumsRecord::Step& step = record_.to_particle;
  const uint16_t* const sum = update_backward("grid_to_particle", step.network, g, nodes);
  uint16_t *const of_particles = rows16(n), *const of_cells = rows16(cells);
  offsets_backward(layer.w_grad, graph::ActivationGradient{.nodes = n,
                                                           .items = {.fixed = corners},
                                                           .g = sum,
                                                           .is_receiver = true,
                                                           .weight = f32(batch.weight),
                                                           .signs = step.signs,
                                                           .out = of_particles,
                                                           .corner_sign = -1,
                                                           .offset = f32(batch.offset)});
  graph::sum_gradients(
      graph::ActivationGradient{
          .nodes = cells,
          .items = {.begin = index(batch.pair_begin), .item = index(batch.pair), .are_long = true},
          .g = sum,
          .row = by_particle,
          .weight = f32(batch.weight),
          .signs = step.signs,
          .out = of_cells},
      nullptr);
  add_product(n, of_particles, record_.particles.f16, layer.w_grad, h, h, layer.b_grad);
  add_product(cells, of_cells, record_.finest, layer.w_grad, 0, h);
  float* const grad = rows32(cells);
  graph::project_back({.rows = cells, .d = {{.rows = of_cells, .weight = packed_.tile(name, 0)}}, .sum32 = grad},
                      nullptr);
  *received = of_particles;
  return grad;
}

const uint16_t* FusedSums::particle_to_grid_backward(const DeviceBatch& batch, const float* g) {
  const std::string name = "particle_to_grid.gather";
  const Fcn::Layer& layer = gather(name);
  const graph::SumsRecord::Step& step = record_.to_grid;
  const uint16_t* const sum = update_backward("particle_to_grid", step.network, g);
  uint16_t* const sent = rows16(batch.particles);
  offsets_backward(layer.w_grad, graph::ActivationGradient{.nodes = batch.particles,
                                                           .items = {.fixed = corners},
                                                           .g = sum,
                                                           .row = {index(batch.cell)},
                                                           .weight = f32(batch.weight),
                                                           .scale = static_cast<float>(config_.p2g_scale),
                                                           .signs = step.signs,
                                                           .out = sent,
                                                           .corner_sign = 1,
                                                           .offset = f32(batch.offset)});
  add_product(batch.particles, sent, record_.particles.f16, layer.w_grad, 0, h, layer.b_grad);
  return sent;
}

float* FusedSums::restrict_backward(std::size_t l, const DeviceBatch& batch, const float* g, const float* skip) {
  const DeviceLevel& fine = batch.level[l];
  const std::string name = "restrict." + std::to_string(l), gather_name = name + ".gather";
  const Fcn::Layer& layer = gather(gather_name);
  const graph::SumsRecord::Step& step = record_.restriction[l];
  const uint16_t* const sum = update_backward(name, step.network, g);
  uint16_t* const sent = rows16(fine.cells);
  offsets_backward(layer.w_grad, graph::ActivationGradient{.nodes = fine.cells,
                                                           .items = {.fixed = 1},
                                                           .g = sum,
                                                           .row = {index(fine.parent)},
                                                           .signs = step.signs,
                                                           .out = sent,
                                                           .offsets = graph::Offsets::octant,
                                                           .octant = index(fine.octant)});
  add_product(fine.cells, sent, record_.restricted[l], layer.w_grad, 0, h, layer.b_grad);
  float* const grad = rows32(fine.cells);
  graph::project_back(
      {.rows = fine.cells, .d = {{.rows = sent, .weight = packed_.tile(gather_name, 0)}}, .add32 = skip, .sum32 = grad},
      nullptr);
  return grad;
}

float* FusedSums::pass_messages_backward(const std::string& block, const graph::SumsRecord::Block& record,
                                         const DeviceLevel& level, float* g) {
  for (int64_t k = config_.message_passing; k-- > 0;) {
    const std::string at_k = graph::numbered(block, k), name = at_k + ".gather";
    const Fcn::Layer& layer = gather(name);
    const graph::SumsRecord::Step& step = record[static_cast<std::size_t>(k)];
    float* const beside_sums = rows32(level.cells);
    const uint16_t* const sum = update_backward(at_k + ".cell", step.network, g, beside_sums);
    uint16_t *const sent = rows16(level.cells), *const received = rows16(level.cells);
    offsets_backward(layer.w_grad, graph::EdgeGradient{.cells = level.cells,
                                                       .edge_begin = index(level.edge_begin),
                                                       .sender = index(level.sender),
                                                       .slot = index(level.slot),
                                                       .reverse = index(level.reverse),
                                                       .g = sum,
                                                       .signs = step.signs,
                                                       .sent = sent,
                                                       .received = received});
    const uint16_t* const nodes = step.network.operand[1].rows;
    add_product(level.cells, sent, nodes, layer.w_grad, 0, h);
    add_product(level.cells, received, nodes, layer.w_grad, h, h, layer.b_grad);
    float* const before = rows32(level.cells);
    graph::project_back(
        {.rows = level.cells,
         .d = {{.rows = sent, .weight = packed_.tile(name, 0)}, {.rows = received, .weight = packed_.tile(name, h)}},
         .add32 = beside_sums,
         .sum32 = before},
        nullptr);
    g = before;
  }
  return g;
}

}  // namespace graupel::train
