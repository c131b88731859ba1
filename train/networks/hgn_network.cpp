#include "train/networks/hgn_network.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/neg.h>

#include "core/system/error.h"
#include "graph/features/features.h"
#include "train/networks/hgn_activations.h"
#include "train/networks/hgn_messages.h"

namespace graupel::train {

namespace {
constexpr int corners = 8;
}  // namespace

std::unique_ptr<HgnNetwork> make_hgn(const graph::HgnConfig& config, const ParameterLayout& layout,
                                     const at::Tensor& flat, const at::Tensor& gradient) {
  if (config.aggregation == graph::Aggregation::activations)
    return std::make_unique<HgnOfActivations>(config, layout, flat, gradient);
  return std::make_unique<HgnOfMessages>(config, layout, flat, gradient);
}

HgnNetwork::HgnNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                       const at::Tensor& gradient)
    : config_(config),
      fcns_(bind_fcns(layout, flat, gradient)),
      embedding_(view_of(layout.find("embedding.weight"), flat)),
      gathers_(config.latent, flat) {
  if (gradient.defined()) embedding_grad_ = view_of(layout.find("embedding.weight"), gradient);
}

DeviceBatch HgnNetwork::upload(const Batch& batch) const {
  const UploadedBatch uploaded(batch, embedding_);
  const auto index = [&](const Part& part) { return uploaded.index(part); };
  DeviceBatch on_device = uploaded.particles(batch);
  on_device.weight = uploaded.numbers(batch.weight);
  on_device.offset = uploaded.rows(batch.offset, 3);
  on_device.cell = index(batch.cell);
  on_device.pair_begin = index(batch.pair_begin);
  on_device.pair = index(batch.pair);
  for (const BatchLevel& level : batch.level) {
    DeviceLevel links;
    links.cells = level.cells;
    links.edge_begin = index(level.edge_begin);
    links.sender = index(level.sender);
    links.receiver = index(level.receiver);
    links.slot = index(level.slot);
    links.reverse = index(level.reverse);
    if (level.parent.count > 0) {
      links.parent = index(level.parent);
      links.child_begin = index(level.child_begin);
      links.child = index(level.child);
    }
    links.octant = index(level.octant);
    add_offsets(links);
    on_device.level.push_back(std::move(links));
  }
  return on_device;
}

DeviceBatch HgnNetwork::attach(const SampleArrays& arrays, bool with_offsets) const {
  const at::TensorOptions number = embedding_.options();
  const auto wrap = [&](const auto* data, int64_t begin, int64_t count, at::ScalarType type) {
    // from_blob takes no const data; the tensor is only read.
    return at::from_blob(const_cast<std::decay_t<decltype(*data)>*>(data) + begin, {count}, number.dtype(type));
  };
  const auto values = [&](const float* data, int64_t width) {
    const at::Tensor all = wrap(data, 0, arrays.particles * width, at::kFloat).to(number.dtype());
    return width == 1 ? all : all.view({-1, width});
  };
  const auto index = [&](const int32_t* data, int64_t begin, int64_t count) {
    return wrap(data, begin, count, at::kInt);
  };
  const graph::GridLinks& links = arrays.links;
  DeviceBatch batch;
  batch.particles = arrays.particles;
  batch.held = arrays.held;
  batch.features = values(arrays.features, arrays.feature_width);
  batch.weight = values(links.weight, corners).view({-1});
  batch.offset = values(links.offset, 3);
  batch.target = values(arrays.target, arrays.target_width);
  batch.type_row = index(arrays.type_row, 0, arrays.particles);
  batch.type_one_hot = one_hot(batch.type_row, embedding_.scalar_type());
  batch.cell = index(links.cell, 0, corners * arrays.particles);
  batch.pair_begin = index(links.pair_begin, 0, arrays.counts.cells[0] + 1);
  batch.pair = index(links.pair, 0, corners * arrays.particles);
  int64_t first_cell = 0, first_edge = 0;
  for (int l = 0; l < arrays.counts.levels; ++l) {
    const int64_t cells = arrays.counts.cells[static_cast<std::size_t>(l)],
                  edges = arrays.counts.edges[static_cast<std::size_t>(l)];
    DeviceLevel level;
    level.cells = cells;
    level.edge_begin = index(links.edge_begin, first_cell, cells + 1) - first_edge;
    level.sender = index(links.sender, first_edge, edges);
    level.receiver = index(links.receiver, first_edge, edges);
    level.slot = index(links.slot, first_edge, edges);
    level.reverse = index(links.reverse, first_edge, edges);
    if (l + 1 < arrays.counts.levels) {
      // All cells of a level are children of the next one, and level 0 has none: children are counted as cells are.
      const int64_t parents = arrays.counts.cells[static_cast<std::size_t>(l) + 1];
      level.parent = index(links.parent, first_cell, cells);
      level.child_begin = index(links.child_begin, first_cell + cells, parents + 1) - first_cell;
      level.child = index(links.child, first_cell, cells);
    }
    level.octant = index(links.octant, first_cell, cells);
    if (with_offsets) add_offsets(level);
    batch.level.push_back(std::move(level));
    first_cell += cells;
    first_edge += edges;
  }
  return batch;
}

void HgnNetwork::add_offsets(DeviceLevel& level) const {
  level.direction = at::index_select(gathers_.slot_vector(), 0, level.slot);
  if (!level.parent.defined()) return;
  // A child at corner b of its parent lies at (b - 1/2) spacings from the parent's centre.
  const at::Tensor axis = at::arange(3, level.octant.options()).view({1, 3});
  level.parent_offset = 0.5 - level.octant.view({-1, 1}).__rshift__(axis).bitwise_and(1).to(embedding_.dtype());
}

at::Tensor HgnNetwork::forward(const DeviceBatch& batch, ForwardRecord* record) const {
  const auto levels = static_cast<std::size_t>(config_.levels);
  GRAUPEL_ASSERT(batch.level.size() == levels);
  if (record) {
    record->down.resize(levels);
    record->up.resize(levels);
    record->restriction.resize(levels);
    record->prolongation.resize(levels);
  }
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  const at::Tensor particles = fcn_forward(fcn("encoder"), input, record ? &record->encoder : nullptr);

  std::vector<at::Tensor> f(levels);
  f[0] = particle_to_grid(batch, particles, record ? &record->to_grid : nullptr);
  for (std::size_t l = 0; l < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    f[l] = pass_messages("down." + std::to_string(l), level, f[l], record ? &record->down[l] : nullptr);
    if (l + 1 == levels) break;
    f[l + 1] = restrict_cells("restrict." + std::to_string(l), level, f[l], record ? &record->restriction[l] : nullptr);
  }
  for (std::size_t l = levels - 1; l-- > 0;) {
    const DeviceLevel& level = batch.level[l];
    const at::Tensor coarse = gather_rows(level.cells, {f[l + 1], level.parent}, {}, {});
    f[l + 1].reset();
    // The offset points from the coarse centre to the fine one.
    const at::Tensor refined =
        fcn_forward(fcn("prolong." + std::to_string(l)), at::cat({coarse, f[l], at::neg(level.parent_offset)}, 1),
                    record ? &record->prolongation[l] : nullptr);
    f[l] = pass_messages("up." + std::to_string(l), level, f[l] + refined, record ? &record->up[l] : nullptr);
  }
  const at::Tensor change = grid_to_particle(batch, f[0], particles, record ? &record->to_particle : nullptr);
  return fcn_forward(fcn("decoder"), particles + change, record ? &record->decoder : nullptr);
}

void HgnNetwork::backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const {
  const auto levels = static_cast<std::size_t>(config_.levels);
  const int64_t h = config_.latent;
  at::Tensor grad_particles = fcn_backward(fcn("decoder"), record.decoder, grad);
  at::Tensor g = grid_to_particle_backward(batch, record.to_particle, grad_particles, grad_particles);

  std::vector<at::Tensor> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    g = pass_messages_backward("up." + std::to_string(l), batch.level[l], record.up[l], g);
    const at::Tensor inputs = fcn_backward(fcn("prolong." + std::to_string(l)), record.prolongation[l], g);
    skip[l] = g + inputs.narrow(1, h, h);
    g = segment_sum(inputs.narrow(1, 0, h), batch.level[l].child_begin, batch.level[l].child, {});
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward("down." + std::to_string(l), batch.level[l], record.down[l], g);
    if (l == 0) break;
    g = skip[l - 1] +
        restrict_cells_backward("restrict." + std::to_string(l - 1), batch.level[l - 1], record.restriction[l - 1], g);
  }
  particle_to_grid_backward(batch, record.to_grid, g, grad_particles);
  const at::Tensor inputs = fcn_backward(fcn("encoder"), record.encoder, grad_particles);
  at::Tensor embedding_grad = embedding_grad_;
  at::mm_out(embedding_grad, batch.type_one_hot.t(), inputs.narrow(1, batch.features.size(1), config_.embedding));
}

}  // namespace graupel::train
