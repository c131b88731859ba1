#include "train/networks/device_batch.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/eq.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/index_select.h>

#include "graph/features/features.h"
#include "graph/topology/gns_graph.h"

namespace graupel::train {

namespace {

constexpr int64_t corners = 8;

/// One copy of a host array to the device, through page-locked memory on the way to a GPU.
template <typename T>
at::Tensor to_device(const std::vector<T>& values, at::ScalarType type, const at::Device& device) {
  // from_blob takes no const data; the tensor is only read.
  const at::Tensor host = at::from_blob(const_cast<T*>(values.data()), {static_cast<int64_t>(values.size())},
                                        at::TensorOptions().dtype(type));
  if (device.is_cpu()) return host.clone();
  return host.pin_memory().to(device, /*non_blocking=*/true);
}

/// [rows, embedding rows], from rows of the embedding table.
at::Tensor one_hot(const at::Tensor& type_row, at::ScalarType number) {
  return at::eq(type_row.view({-1, 1}), at::arange(graph::embedding_rows, type_row.options()).view({1, -1})).to(number);
}

/// Directions of the edges and ways to the parents.
void add_offsets(DeviceLevel& level, const at::Tensor& like) {
  // A sender at -x (slot 0) sees its receiver at +x.
  std::vector<float> directions;
  for (int slot = 0; slot < 6; ++slot)
    for (int d = 0; d < 3; ++d) directions.push_back(slot / 2 != d ? 0.0f : slot % 2 == 0 ? 1.0f : -1.0f);
  const at::Tensor of_slot = to_device(directions, at::kFloat, like.device()).to(like.dtype()).view({6, 3});
  level.direction = at::index_select(of_slot, 0, level.slot);
  if (!level.parent.defined()) return;
  // A child at corner b of its parent lies at (b - 1/2) spacings from the parent's centre.
  const at::Tensor axis = at::arange(3, level.octant.options()).view({1, 3});
  level.parent_offset = 0.5 - level.octant.view({-1, 1}).__rshift__(axis).bitwise_and(1).to(like.dtype());
}

/// Arrays that lie in the device's memory, as tensors. from_blob takes no const data; the tensors are only read.
struct Attached {
  at::Tensor like;
  at::Tensor numbers(const float* data, int64_t rows, int64_t width) const {
    return at::from_blob(const_cast<float*>(data), {rows, width}, like.options().dtype(at::kFloat)).to(like.dtype());
  }
  at::Tensor index(const int32_t* data, int64_t begin, int64_t count) const {
    return at::from_blob(const_cast<int32_t*>(data) + begin, {count}, like.options().dtype(at::kInt));
  }
};

DeviceLevel attached_pairs(const SampleArrays& arrays, const Attached& on) {
  DeviceLevel links;
  links.cells = arrays.rows;
  links.edges = arrays.pair_count;
  links.edge_begin = on.index(arrays.pairs.begin, 0, arrays.rows + 1);
  links.sender = on.index(arrays.pairs.sender, 0, arrays.pair_count);
  links.receiver = on.index(arrays.pairs.receiver, 0, arrays.pair_count);
  links.reverse = on.index(arrays.pairs.reverse, 0, arrays.pair_count);
  links.direction = on.numbers(arrays.pairs.features, arrays.pair_count, graph::edge_feature_count);
  return links;
}

void attach_cells(const SampleArrays& arrays, const Attached& on, bool with_offsets, DeviceBatch& batch) {
  const graph::GridLinks& links = arrays.links;
  batch.weight = on.numbers(links.weight, arrays.particles, corners).view({-1});
  batch.offset = on.numbers(links.offset, arrays.particles, 3);
  batch.cell = on.index(links.cell, 0, corners * arrays.particles);
  batch.pair_begin = on.index(links.pair_begin, 0, arrays.counts.cells[0] + 1);
  batch.pair = on.index(links.pair, 0, corners * arrays.particles);
  int64_t first_cell = 0, first_edge = 0;
  for (int l = 0; l < arrays.counts.levels; ++l) {
    const int64_t cells = arrays.counts.cells[static_cast<std::size_t>(l)],
                  edges = arrays.counts.edges[static_cast<std::size_t>(l)];
    DeviceLevel level;
    level.cells = cells;
    level.edges = edges;
    level.edge_begin = on.index(links.edge_begin, first_cell, cells + 1) - first_edge;
    level.sender = on.index(links.sender, first_edge, edges);
    level.receiver = on.index(links.receiver, first_edge, edges);
    level.slot = on.index(links.slot, first_edge, edges);
    level.reverse = on.index(links.reverse, first_edge, edges);
    if (l + 1 < arrays.counts.levels) {
      // All cells of a level are children of the next one, and level 0 has none: children are counted as cells are.
      const int64_t parents = arrays.counts.cells[static_cast<std::size_t>(l) + 1];
      level.parent = on.index(links.parent, first_cell, cells);
      level.child_begin = on.index(links.child_begin, first_cell + cells, parents + 1) - first_cell;
      level.child = on.index(links.child, first_cell, cells);
    }
    level.octant = on.index(links.octant, first_cell, cells);
    if (with_offsets) add_offsets(level, on.like);
    batch.level.push_back(std::move(level));
    first_cell += cells;
    first_edge += edges;
  }
}

}  // namespace

DeviceBatch upload(const Batch& batch, const at::Tensor& like) {
  const at::Tensor indices = to_device(batch.indices, at::kInt, like.device()),
                   numbers = to_device(batch.numbers, at::kFloat, like.device()).to(like.dtype());
  const auto index = [&](const Part& part) { return indices.narrow(0, part.begin, part.count); };
  const auto rows = [&](const Part& part, int64_t width) {
    return numbers.narrow(0, part.begin, part.count).view({-1, width});
  };
  DeviceBatch on_device;
  on_device.particles = batch.particles();
  on_device.uncounted = batch.uncounted;
  if (batch.uncounted > 0) on_device.counted = rows(batch.counted, 1);
  on_device.features = rows(batch.features, batch.feature_width);
  if (batch.target.count > 0) on_device.target = rows(batch.target, batch.target_width);
  on_device.type_row = index(batch.type_row);
  on_device.type_one_hot = one_hot(on_device.type_row, numbers.scalar_type());
  const bool of_cells = batch.weight.count > 0;
  if (of_cells) {
    on_device.weight = rows(batch.weight, 1).view({-1});
    on_device.offset = rows(batch.offset, 3);
    on_device.cell = index(batch.cell);
    on_device.pair_begin = index(batch.pair_begin);
    on_device.pair = index(batch.pair);
  }
  for (const BatchLevel& level : batch.level) {
    DeviceLevel& links = on_device.level.emplace_back();
    static_cast<graph::LevelGraph<at::Tensor>&>(links) = level.as<at::Tensor>(index);
    if (level.parent.count == 0) links.parent.reset();
    if (!of_cells) {
      links.direction = rows(batch.edge_features, graph::edge_feature_count);
      continue;
    }
    add_offsets(links, numbers);
  }
  return on_device;
}

DeviceBatch attach(const SampleArrays& arrays, const at::Tensor& like, bool with_offsets) {
  const Attached on{like};
  const bool of_cells = arrays.counts.levels > 0;
  DeviceBatch batch;
  batch.particles = arrays.particles;
  batch.uncounted = arrays.uncounted;
  if (arrays.uncounted > 0) batch.counted = on.numbers(arrays.counted, arrays.particles, 1);
  const int64_t nodes = of_cells ? arrays.particles : arrays.rows;
  batch.features = on.numbers(arrays.features, nodes, arrays.feature_width);
  batch.target = on.numbers(arrays.target, arrays.particles, arrays.target_width);
  batch.type_row = on.index(arrays.type_row, 0, nodes);
  batch.type_one_hot = one_hot(batch.type_row, like.scalar_type());
  if (of_cells)
    attach_cells(arrays, on, with_offsets, batch);
  else
    batch.level.push_back(attached_pairs(arrays, on));
  return batch;
}

}  // namespace graupel::train
