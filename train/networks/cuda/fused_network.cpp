#include "train/networks/cuda/fused_network.h"

namespace graupel::train {

namespace {

/// Row r of a [pairs, .] array belongs to particle r / 8 and corner r % 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};

}  // namespace

graph::RowLatents FusedNetwork::to_decoder(const graph::HgnGraph& graph) {
  return {graph::forward_to_decoder(packed_, graph, *this, record_, nullptr), nullptr};
}

float* FusedNetwork::back_to_encoder(const DeviceBatch& batch, float* grad_particles) {
  const auto levels = static_cast<std::size_t>(config_.levels);

  // Step 11: the way from the cells
  const Fcn& from_grid = fcn("grid_to_particle");
  const graph::RowNetworkGradient pairs = back_through(
      "grid_to_particle",
      {.network = record_.to_particle, .g32 = grad_particles, .g_row = by_particle, .g_weight = f32(batch.weight)});
  uint16_t* const per_cell = rows16(batch.level[0].cells);
  graph::sum_segments({.segments = batch.level[0].cells,
                       .begin = index(batch.pair_begin),
                       .item = index(batch.pair),
                       .are_long = true,
                       .source = pairs.d_sum,
                       .out16 = per_cell},
                      nullptr);
  add_product(batch.level[0].cells, per_cell, record_.finest, from_grid.w1_grad, 0, h);
  float* g = rows32(batch.level[0].cells);
  graph::project_back({.rows = batch.level[0].cells,
                       .d = {{.rows = per_cell, .weight = packed_.tile("grid_to_particle", 0)}},
                       .sum32 = g},
                      nullptr);
  pairs_to_particles(batch, "grid_to_particle", pairs, h, 1, grad_particles);

  std::vector<float*> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    g = pass_messages_backward("up." + std::to_string(l), record_.up[l], batch.level[l], g);
    skip[l] = rows32(batch.level[l].cells);
    g = prolong_backward(l, record_.prolongation[l], batch, g, skip[l]);
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward("down." + std::to_string(l), record_.down[l], batch.level[l], g);
    if (l == 0) break;
    const DeviceLevel& fine = batch.level[l - 1];
    const std::string name = "restrict." + std::to_string(l - 1);
    const Fcn& net = fcn(name);
    float* const fine_grad = rows32(fine.cells);
    graph::RowNetworkGradient way{.network = record_.restriction[l - 1], .g32 = g, .g_row = {index(fine.parent)}};
    way.operand[0] = {.add32 = skip[l - 1], .d32 = fine_grad};
    way = back_through(name, way);
    add_product(fine.cells, way.d_sum, way.network.operand[0].rows, net.w1_grad, 0, h, net.b1_grad);
    octants_backward(fine, way.d_sum, 1, net.w1_grad);
    g = fine_grad;
  }

  // Step 1: the way to the cells
  const graph::RowNetworkGradient to =
      back_through("particle_to_grid", {.network = record_.to_grid,
                                        .g32 = g,
                                        .g_row = {index(batch.cell)},
                                        .g_weight = f32(batch.weight),
                                        .g_scale = static_cast<float>(config_.p2g_scale)});
  pairs_to_particles(batch, "particle_to_grid", to, 0, -1, grad_particles);
  return grad_particles;
}

void FusedNetwork::pairs_to_particles(const DeviceBatch& batch, const std::string& name,
                                      const graph::RowNetworkGradient& pairs, int64_t particle_column,
                                      float offset_sign, float* grad_particles) {
  const Fcn& net = fcn(name);
  uint16_t* const per_particle = rows16(batch.particles);
  offsets_backward(net.w1_grad, graph::ActivationGradient{.nodes = batch.particles,
                                                          .items = {.fixed = corners},
                                                          .g = pairs.d_sum,
                                                          .out = per_particle,
                                                          .corner_sign = -offset_sign,
                                                          .offset = f32(batch.offset)});
  add_product(batch.particles, per_particle, record_.particles.f16, net.w1_grad, particle_column, h, net.b1_grad);
  graph::project_back({.rows = batch.particles,
                       .d = {{.rows = per_particle, .weight = packed_.tile(name, particle_column)}},
                       .add32 = grad_particles,
                       .sum32 = grad_particles},
                      nullptr);
}

float* FusedNetwork::pass_messages_backward(const std::string& block, const graph::HgnRecord::Block& record,
                                            const DeviceLevel& level, float* grad) {
  const int64_t edges = level.sender.size(0);
  uint16_t* grad_latent = nullptr;  // of the edge latents after iteration k; none after the last
  for (int64_t k = config_.message_passing; k-- > 0;) {
    const graph::HgnRecord::Iteration& iteration = record[static_cast<std::size_t>(k)];
    const std::string edge_name = block + "." + std::to_string(k) + ".edge";
    const std::string cell_name = block + "." + std::to_string(k) + ".cell";
    const Fcn &edge_net = fcn(edge_name), &cell_net = fcn(cell_name);

    uint16_t* const received = rows16(level.cells);
    float *const message_grad = rows32(level.cells), *const node_grad = rows32(level.cells);
    graph::RowNetworkGradient cell{.network = iteration.cell, .g32 = grad};
    cell.network.operand[0].save = received;
    cell.operand[0] = {.d32 = message_grad};
    cell.operand[1] = {.add32 = grad, .d32 = node_grad};
    cell = back_through(cell_name, cell);
    const uint16_t* const nodes = cell.network.operand[1].rows;
    add_product(level.cells, cell.d_sum, received, cell_net.w1_grad, 0, h);
    add_product(level.cells, cell.d_sum, nodes, cell_net.w1_grad, h, h, cell_net.b1_grad);

    graph::RowNetworkGradient edge{.network = iteration.edge, .g32 = message_grad, .g_row = {index(level.receiver)}};
    edge.g16 = grad_latent;
    if (k > 0) {
      grad_latent = rows16(edges);
      edge.operand[0] = {.add16 = edge.g16, .d16 = grad_latent};
    }
    edge = back_through(edge_name, edge);
    if (k > 0)
      add_product(edges, edge.d_sum, edge.network.operand[0].rows, edge_net.w1_grad, 2 * h, h);
    else
      offsets_backward(edge_net.w1_grad, graph::ActivationGradient{.nodes = level.cells,
                                                                   .items = {.begin = index(level.edge_begin)},
                                                                   .g = edge.d_sum,
                                                                   .offsets = graph::Offsets::slot,
                                                                   .slot = index(level.slot)});

    uint16_t *const sent = rows16(level.cells), *const arrived = rows16(level.cells);
    float* const before = rows32(level.cells);
    graph::project_back({.rows = level.cells,
                         .d = {{.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .item = index(level.reverse),
                                .save = sent,
                                .weight = packed_.tile(edge_name, 0)},
                               {.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .save = arrived,
                                .weight = packed_.tile(edge_name, h)}},
                         .add32 = node_grad,
                         .sum32 = before},
                        nullptr);
    add_product(level.cells, sent, nodes, edge_net.w1_grad, 0, h);
    add_product(level.cells, arrived, nodes, edge_net.w1_grad, h, h, edge_net.b1_grad);
    grad = before;
  }
  return grad;
}

}  // namespace graupel::train
