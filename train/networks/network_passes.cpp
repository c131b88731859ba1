#include "train/networks/network_passes.h"

#include <ATen/ops/arange.h>
#include <ATen/ops/eq.h>
#include <ATen/ops/from_blob.h>

#include "graph/features/features.h"
#include "graph/topology/gns_graph.h"
#include "train/networks/gns_passes.h"
#include "train/networks/hgn_network.h"

namespace graupel::train {

namespace {

template <typename T>
at::Tensor copy_to(const std::vector<T>& values, at::ScalarType type, const at::Device& device) {
  // from_blob takes no const data; the tensor is only read.
  const at::Tensor host = at::from_blob(const_cast<T*>(values.data()), {static_cast<int64_t>(values.size())},
                                        at::TensorOptions().dtype(type));
  if (device.is_cpu()) return host.clone();
  return host.pin_memory().to(device, /*non_blocking=*/true);
}

}  // namespace

std::unique_ptr<NetworkPasses> make_passes(const NetworkConfig& config, int64_t checkpoint_layers,
                                           const ParameterLayout& layout, const at::Tensor& flat,
                                           const at::Tensor& gradient) {
  if (const auto* hgn = std::get_if<graph::HgnConfig>(&config)) return make_hgn(*hgn, layout, flat, gradient);
  return std::make_unique<GnsPasses>(std::get<graph::GnsConfig>(config), checkpoint_layers, layout, flat, gradient);
}

at::Tensor to_device(const std::vector<float>& values, const at::Device& device) {
  return copy_to(values, at::kFloat, device);
}
at::Tensor to_device(const std::vector<int32_t>& values, const at::Device& device) {
  return copy_to(values, at::kInt, device);
}

UploadedBatch::UploadedBatch(const Batch& batch, const at::Tensor& like)
    : indices_(to_device(batch.indices, like.device())),
      numbers_(to_device(batch.numbers, like.device()).to(like.dtype())) {}

DeviceBatch UploadedBatch::particles(const Batch& batch) const {
  DeviceBatch on_device;
  on_device.particles = batch.particles();
  on_device.held = batch.held;
  on_device.features = rows(batch.features, batch.feature_width);
  if (batch.target.count > 0) on_device.target = rows(batch.target, batch.target_width);
  on_device.type_row = index(batch.type_row);
  on_device.type_one_hot = one_hot(on_device.type_row, numbers_.scalar_type());
  return on_device;
}

DeviceLevel UploadedBatch::links(const BatchLevel& level, const Part& edge_features) const {
  DeviceLevel links;
  links.cells = level.cells;
  links.edge_begin = index(level.edge_begin);
  links.sender = index(level.sender);
  links.receiver = index(level.receiver);
  links.reverse = index(level.reverse);
  links.direction = rows(edge_features, graph::edge_feature_count);
  return links;
}

// from_blob takes no const data; the tensors are only read.
at::Tensor attached(const float* data, int64_t rows, int64_t width, const at::Tensor& like) {
  return at::from_blob(const_cast<float*>(data), {rows, width}, like.options().dtype(at::kFloat)).to(like.dtype());
}
at::Tensor attached(const int32_t* data, int64_t count, const at::Tensor& like) {
  return at::from_blob(const_cast<int32_t*>(data), {count}, like.options().dtype(at::kInt));
}

DeviceLevel attached_links(const SampleArrays& arrays, const at::Tensor& like) {
  DeviceLevel links;
  links.cells = arrays.rows;
  links.edge_begin = attached(arrays.pairs.begin, arrays.rows + 1, like);
  links.sender = attached(arrays.pairs.sender, arrays.pair_count, like);
  links.receiver = attached(arrays.pairs.receiver, arrays.pair_count, like);
  links.reverse = attached(arrays.pairs.reverse, arrays.pair_count, like);
  links.direction = attached(arrays.pairs.features, arrays.pair_count, graph::edge_feature_count, like);
  return links;
}

at::Tensor one_hot(const at::Tensor& type_row, at::ScalarType number) {
  return at::eq(type_row.view({-1, 1}), at::arange(graph::embedding_rows, type_row.options()).view({1, -1})).to(number);
}

}  // namespace graupel::train
