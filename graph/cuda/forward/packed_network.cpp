#include "graph/cuda/forward/packed_network.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::graph {

namespace {

constexpr int64_t h = layer_width;
constexpr int64_t second = -1;  ///< stands for W2 among the columns of W1

DeviceFcn weights_of(const PlanLayer& layer, const PackedNetwork::Parameters& parameter) {
  const auto find = [&](const char* tensor) { return parameter(layer.name + tensor); };
  DeviceFcn fcn{.inputs = static_cast<int32_t>(layer.inputs), .slope = static_cast<float>(layer.slope)};
  const bool is_linear = layer.is_linear();
  fcn.w1 = find(is_linear ? ".weight" : ".layer1.weight");
  fcn.b1 = find(is_linear ? ".bias" : ".layer1.bias");
  if (is_linear) return fcn;
  fcn.w2 = find(".layer2.weight");
  fcn.b2 = find(".layer2.bias");
  if (!layer.norm) return fcn;
  fcn.gamma = find(".norm.weight");
  fcn.beta = find(".norm.bias");
  return fcn;
}

}  // namespace

LinkOffsets offsets_of(LinkKind links) {
  const bool of_parents = links == LinkKind::to_parent || links == LinkKind::from_parent;
  const bool up = links == LinkKind::cell_to_particle || links == LinkKind::from_parent;
  const Offsets of_others = links == LinkKind::cell_neighbors ? Offsets::slot : Offsets::corner;
  return {of_parents ? Offsets::octant : of_others, up ? -1.0f : 1.0f};
}

bool PackedNetwork::fits(const LayerPlan& plan) {
  return plan.layers.front().inputs <= h && std::all_of(plan.layers.begin(), plan.layers.end(), [](const auto& layer) {
           return layer.hidden == h && layer.hidden_layers <= 1 && (!layer.norm || layer.outputs == h);
         });
}

PackedNetwork::PackedNetwork(LayerPlan plan, const Parameters& parameter) : plan_(std::move(plan)) {
  GRAUPEL_ASSERT(fits(plan_));
  std::vector<TileSource> sources;
  const auto add = [&](const std::string& name, int64_t column, const float* matrix, int32_t stride) {
    tile_of_[{name, column}] = static_cast<int64_t>(sources.size());
    sources.push_back({matrix, stride, h});
  };
  for (const PlanLayer& layer : plan_.layers) {
    const DeviceFcn& fcn = fcns_[layer.name] = weights_of(layer, parameter);
    if (fcn.gamma) add(layer.name, second, fcn.w2, h);
    for (int64_t column = 0; column + h <= fcn.inputs; column += h)
      add(layer.name, column, fcn.w1 + column, fcn.inputs);
  }
  tile_sources_.upload(sources);
  tiles_.resize_discard(sources.size() * tile_numbers);
  add_tables(parameter("embedding.weight"));
}

void PackedNetwork::add_tables(const float* embedding) {
  std::vector<OffsetTable> sources;
  for (const PlanOperation& op : plan_.operations) {
    const bool is_encoder = op.kind == operation::encode;
    if (!is_encoder && !(op.kind == operation::gather && op.offset)) continue;
    const PlanLayer& layer = plan_.layers[static_cast<std::size_t>(op.layer)];
    const DeviceFcn& net = fcn(layer.name);
    table_of_[layer.name] = static_cast<int64_t>(sources.size());
    // The type's embedding, or a link's offset, is the last input; a row for each of the few that there are.
    if (is_encoder) {
      sources.push_back({Offsets::embedding, 1, net.w1 + layer.inputs - plan_.embedding, net.inputs, net.b1, embedding,
                         static_cast<int32_t>(plan_.embedding)});
      continue;
    }
    const LinkOffsets offsets = offsets_of(op.links.kind);
    sources.push_back({offsets.kind, offsets.sign, net.w1 + layer.inputs - op.links.offset(), net.inputs,
                       offsets.kind == Offsets::octant ? net.b1 : nullptr, nullptr, 0});
  }
  table_sources_.upload(sources);
  tables_.resize_discard(sources.size() * most_table_rows * h);
}

void PackedNetwork::refresh(void* stream) {
  pack_tiles(static_cast<int>(tile_sources_.size()), tile_sources_.data(), tiles_.data(), stream);
  make_tables(static_cast<int>(table_sources_.size()), table_sources_.data(), tables_.data(), stream);
}

const uint16_t* PackedNetwork::tile(const std::string& fcn, int64_t first_column) const {
  return tiles_.data() + tile_of_.at({fcn, first_column}) * tile_numbers;
}

const float* PackedNetwork::table(const std::string& fcn) const {
  return tables_.data() + table_of_.at(fcn) * most_table_rows * h;
}

FusedMlp PackedNetwork::network(const std::string& name, int64_t rows, const int32_t* row_count) const {
  const DeviceFcn& net = fcn(name);
  FusedMlp network;
  network.rows = rows;
  network.row_count = row_count;
  network.slope = net.slope;
  network.w2 = tile(name, second);
  network.b2 = net.b2;
  network.gamma = net.gamma;
  network.beta = net.beta;
  return network;
}

Decoder PackedNetwork::decoder() const {
  const PlanLayer& layer = plan_.layers.back();
  const DeviceFcn& net = fcn(layer.name);
  return {.frames = static_cast<int>(layer.outputs / 3),
          .w1 = tile(layer.name, 0),
          .b1 = net.b1,
          .w2 = net.w2,
          .b2 = net.b2,
          .slope = net.slope};
}

}  // namespace graupel::graph
