#include "train/networks/cuda/fused_network.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/from_blob.h>
#include <c10/core/GradMode.h>
#include <torch/csrc/autograd/autograd.h>

#include <cstdint>

namespace graupel::train {

namespace {

/// At a place from which the kernels read four numbers at once: those of an uploaded batch begin anywhere.
at::Tensor aligned(const at::Tensor& tensor) {
  constexpr std::uintptr_t bytes = 16;
  const bool is_aligned = reinterpret_cast<std::uintptr_t>(tensor.data_ptr()) % bytes == 0;
  return is_aligned && tensor.is_contiguous() ? tensor : tensor.clone();
}

}  // namespace

FusedNetwork::FusedNetwork(const ParameterLayout& layout, const at::Tensor& flat, const at::Tensor& gradient)
    : number_(flat.options()),
      half_(flat.options().dtype(at::kBFloat16)),
      packed_(layout.plan(), [&](const std::string& name) { return f32(flat) + layout.find(name).begin; }),
      layout_(layout),
      flat_(flat),
      gradient_(gradient),
      engine_(layout, flat) {
  for (const Parameter& parameter : layout_.parameters()) parameter_[parameter.name] = &parameter;
}

graph::NetworkGraph FusedNetwork::begin(const DeviceBatch& batch) {
  kept_.clear();
  packed_.refresh(nullptr);
  graph::NetworkGraph graph;
  const bool has_grid = batch.cell.defined();
  graph.particles = has_grid ? batch.particles : batch.level.front().cells;
  graph.features = f32(kept_.emplace_back(batch.features.contiguous()));
  graph.type_row = index(batch.type_row);
  for (const DeviceLevel& level : batch.level) graph.level.push_back({level.as<const int32_t*>(index)});
  if (!has_grid) {
    graph.edge_features = f32(kept_.emplace_back(aligned(batch.level.front().direction)));
    return graph;
  }
  graph.weight = f32(batch.weight);
  graph.offset = f32(batch.offset);
  graph.cell = index(batch.cell);
  graph.pair_begin = index(batch.pair_begin);
  graph.pair = index(batch.pair);
  return graph;
}

const uint16_t* FusedNetwork::packed(const at::Tensor& numbers) {
  uint16_t* const rows = rows16(numbers.size(0));
  const at::Tensor dense = kept_.emplace_back(numbers.contiguous());
  graph::pack_rows(numbers.size(0), static_cast<int>(numbers.size(1)), f32(dense), rows, nullptr);
  return rows;
}

void FusedNetwork::back_through(const std::string& name, graph::FusedMlpGradient gradient_of, const Traces& traces) {
  gradient_of.hidden = traces.hidden;
  gradient_of.d_raw = traces.d_raw;
  gradient_of.d_sum = traces.d_sum;
  gradient_of.norm_partial = partials(graph::most_norm_partials(), 2);
  const int partial_rows = graph::backward(gradient_of, nullptr);
  add_product(gradient_of.network.rows, traces.d_raw, traces.hidden, name + ".layer2", 0, h, true);
  products_.add({.rows = partial_rows,
                 .partial = gradient_of.norm_partial,
                 .parts = 2,
                 .out = f32(gradient(name + ".norm.weight")),
                 .bias = f32(gradient(name + ".norm.bias"))});
}

void FusedNetwork::add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const std::string& matrix,
                               int64_t first_column, int64_t columns, bool with_bias) {
  const at::Tensor out = gradient(matrix + ".weight");
  products_.add({.rows = rows,
                 .d = d,
                 .x = x,
                 .out = f32(out) + first_column,
                 .stride = static_cast<int32_t>(out.stride(0)),
                 .columns = static_cast<int32_t>(columns),
                 .bias = with_bias ? f32(gradient(matrix + ".bias")) : nullptr});
}

at::Tensor FusedNetwork::decode(float* latents, int64_t particles) {
  const c10::AutoGradMode with_grad(true);
  before_decoder_ = at::from_blob(latents, {particles, h}, number_).set_requires_grad(true);
  decoded_ = engine_.fcn(plan().layers.back(), before_decoder_);
  return decoded_.detach();
}

at::Tensor FusedNetwork::decoder_backward(const at::Tensor& grad) {
  const std::string& name = plan().layers.back().name;
  std::vector<std::string> weights;
  torch::autograd::variable_list leaves = {before_decoder_};
  for (const char* part : {".layer1.weight", ".layer1.bias", ".layer2.weight", ".layer2.bias"})
    leaves.push_back(engine_.parameter(weights.emplace_back(name + part)));
  const torch::autograd::variable_list found = torch::autograd::grad({decoded_}, leaves, {grad});
  for (std::size_t i = 0; i < weights.size(); ++i) gradient(weights[i]).copy_(found[i + 1]);
  decoded_.reset();
  return found.front();
}

}  // namespace graupel::train
