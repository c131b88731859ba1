#include "train/networks/paper_form.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/embedding_bag.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/leaky_relu.h>
#include <ATen/ops/neg.h>
#include <ATen/ops/sum.h>

namespace graupel::train {

namespace {

constexpr int64_t corners = 8;
constexpr int64_t sum_of_bag = 0;

at::Tensor rows_at(const at::Tensor& table, const at::Tensor& index) { return at::index_select(table, 0, index); }

/// Sums over the sorted segments of `item`, which begin at `begin` [segments + 1]; `weight` may be undefined. An
/// embedding bag is libtorch's one parallel operation for that on a CPU: index_add takes one row after the other.
at::Tensor sum_segments(const at::Tensor& source, const at::Tensor& item, const at::Tensor& begin,
                        const at::Tensor& weight = {}) {
  return std::get<0>(at::embedding_bag(source, item, begin, false, sum_of_bag, false, weight,
                                       /*include_last_offset=*/true));
}

/// Every row of `rows` eight times: [particles * 8, width].
at::Tensor for_each_corner(const at::Tensor& rows) {
  return rows.unsqueeze(1).expand({-1, corners, -1}).reshape({-1, rows.size(1)});
}

/// Offsets (x - centre) / R of the pairs, [particles * 8, 3].
at::Tensor pair_offsets(const at::Tensor& offset) {
  const at::Tensor corner = at::arange(corners, offset.options().dtype(at::kInt)).view({-1, 1});
  const at::Tensor axis = at::arange(3, corner.options()).view({1, 3});
  const at::Tensor bits = corner.__rshift__(axis).bitwise_and(1).to(offset.dtype());
  return (offset.unsqueeze(1) - bits).reshape({-1, 3});
}

bool sums_activations(const graph::HgnConfig& config) { return config.aggregation == graph::Aggregation::activations; }

}  // namespace

WholeNetwork::WholeNetwork(const NetworkConfig& config, const ParameterLayout& layout, const at::Tensor& flat)
    : config_(config),
      fcns_(bind_fcns(layout, flat, {})),
      gathers_(bind_gathers(layout, flat, {})),
      embedding_(view_of(layout.find("embedding.weight"), flat)) {}

/// An FCN on concatenated inputs.
at::Tensor WholeNetwork::apply(const std::string& name, const at::TensorList& inputs) const {
  return fcn_forward(fcns_.at(name), inputs.size() == 1 ? inputs[0] : at::cat(inputs, 1), nullptr);
}

at::Tensor WholeNetwork::gather(const std::string& name, const at::TensorList& inputs) const {
  const Fcn::Layer& layer = gathers_.at(name + ".gather");
  at::Tensor activated = at::addmm(layer.b, at::cat(inputs, 1), layer.w.t());
  at::leaky_relu_(activated, leaky_slope);
  return activated;
}

at::Tensor WholeNetwork::forward(const DeviceBatch& batch) const {
  const at::Tensor types = rows_at(embedding_, batch.type_row);
  if (const auto* config = std::get_if<graph::HgnConfig>(&config_))
    return hgn(*config, batch, apply("encoder", {batch.features, types}));
  return gns(std::get<graph::GnsConfig>(config_), batch, apply("encoder.node", {batch.features, types}));
}

at::Tensor WholeNetwork::hgn(const graph::HgnConfig& config, const DeviceBatch& batch,
                             const at::Tensor& particles) const {
  const at::Tensor of_pair = for_each_corner(particles), offset = pair_offsets(batch.offset);
  const auto levels = static_cast<std::size_t>(config.levels);
  std::vector<at::Tensor> f(levels);
  f[0] = to_grid(config, batch, of_pair, offset);
  for (std::size_t l = 0; l < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    const std::string number = std::to_string(l);
    f[l] = pass_messages(config, "down." + number, level, f[l]);
    if (l + 1 < levels) f[l + 1] = to_coarse(config, "restrict." + number, level, f[l]);
  }
  for (std::size_t l = levels - 1; l-- > 0;) {
    const DeviceLevel& level = batch.level[l];
    const std::string number = std::to_string(l);
    const at::Tensor refined =
        apply("prolong." + number, {rows_at(f[l + 1], level.parent), f[l], at::neg(level.parent_offset)});
    f[l] = pass_messages(config, "up." + number, level, f[l] + refined);
  }
  return apply("decoder", {particles + to_particles(config, batch, f[0], particles, of_pair, offset)});
}

at::Tensor WholeNetwork::to_grid(const graph::HgnConfig& config, const DeviceBatch& batch, const at::Tensor& of_pair,
                                 const at::Tensor& offset) const {
  const std::string name = "particle_to_grid";
  const std::vector<at::Tensor> inputs = {of_pair, at::neg(offset)};
  const at::Tensor sums = sum_segments(sums_activations(config) ? gather(name, inputs) : apply(name, inputs),
                                       batch.pair, batch.pair_begin, rows_at(batch.weight, batch.pair)) *
                          config.p2g_scale;
  return sums_activations(config) ? apply(name, {sums}) : sums;
}

at::Tensor WholeNetwork::to_coarse(const graph::HgnConfig& config, const std::string& name, const DeviceLevel& level,
                                   const at::Tensor& cells) const {
  const std::vector<at::Tensor> inputs = {cells, level.parent_offset};
  const at::Tensor sums = sum_segments(sums_activations(config) ? gather(name, inputs) : apply(name, inputs),
                                       level.child, level.child_begin);
  return sums_activations(config) ? apply(name, {sums}) : sums;
}

at::Tensor WholeNetwork::to_particles(const graph::HgnConfig& config, const DeviceBatch& batch, const at::Tensor& cells,
                                      const at::Tensor& particles, const at::Tensor& of_pair,
                                      const at::Tensor& offset) const {
  const std::string name = "grid_to_particle";
  const std::vector<at::Tensor> inputs = {rows_at(cells, batch.cell), of_pair, offset};
  const at::Tensor pairs = sums_activations(config) ? gather(name, inputs) : apply(name, inputs);
  const at::Tensor sums = at::sum((pairs * batch.weight.view({-1, 1})).view({-1, corners, config.latent}), /*dim=*/1);
  return sums_activations(config) ? apply(name, {sums, particles}) : sums;
}

at::Tensor WholeNetwork::pass_activations(const graph::HgnConfig& config, const std::string& name,
                                          const DeviceLevel& level, at::Tensor nodes) const {
  const at::Tensor all_edges = at::arange(level.sender.size(0), level.sender.options());
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string at_k = name + "." + std::to_string(k);
    const at::Tensor edges =
        gather(at_k, {rows_at(nodes, level.sender), rows_at(nodes, level.receiver), level.direction});
    nodes = nodes + apply(at_k + ".cell", {sum_segments(edges, all_edges, level.edge_begin), nodes});
  }
  return nodes;
}

at::Tensor WholeNetwork::pass_messages(const graph::HgnConfig& config, const std::string& name,
                                       const DeviceLevel& level, at::Tensor nodes) const {
  if (sums_activations(config)) return pass_activations(config, name, level, nodes);
  const at::Tensor all_edges = at::arange(level.sender.size(0), level.sender.options());
  at::Tensor latent = level.direction;
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string at_k = name + "." + std::to_string(k);
    const at::Tensor messages =
        apply(at_k + ".edge", {rows_at(nodes, level.sender), rows_at(nodes, level.receiver), latent});
    nodes = nodes + apply(at_k + ".cell", {sum_segments(messages, all_edges, level.edge_begin), nodes});
    latent = k == 0 ? messages : latent + messages;
  }
  return nodes;
}

at::Tensor WholeNetwork::gns(const graph::GnsConfig& config, const DeviceBatch& batch, at::Tensor nodes) const {
  const DeviceLevel& links = batch.level.front();
  const at::Tensor all_edges = at::arange(links.sender.size(0), links.sender.options());
  at::Tensor latent = apply("encoder.edge", {links.direction});
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string step = "step." + std::to_string(k);
    const at::Tensor messages =
        apply(step + ".edge", {rows_at(nodes, links.sender), rows_at(nodes, links.receiver), latent});
    nodes = nodes + apply(step + ".node", {sum_segments(messages, all_edges, links.edge_begin), nodes});
    latent = latent + messages;
  }
  return apply("decoder", {nodes.narrow(0, 0, batch.particles)});
}

}  // namespace graupel::train
