#include "graph/cuda/forward/packed_hgn.h"

#include "core/system/error.h"
#include "graph/features/features.h"

namespace graupel::graph {

namespace {

constexpr int64_t h = layer_width;
constexpr int64_t second = -1;  ///< stands for W2 among the columns of W1

}  // namespace

bool PackedHgn::fits(const HgnConfig& config) { return config.latent == h && config.input_width() <= h; }

PackedHgn::PackedHgn(const HgnConfig& config, std::map<std::string, DeviceFcn> fcns, const float* embedding)
    : config_(config), plan_(plan_of(config)), fcns_(std::move(fcns)), embedding_(embedding) {
  GRAUPEL_ASSERT(fits(config));
  std::vector<TileSource> sources;
  const auto add = [&](const std::string& name, int64_t column, const float* from, int32_t stride) {
    tile_of_[{name, column}] = static_cast<int64_t>(sources.size());
    sources.push_back({from, stride, h});
  };
  for (const auto& [name, fcn] : fcns_) {
    if (fcn.gamma) add(name, second, fcn.w2, h);
    for (int64_t column = 0; column + h <= fcn.inputs; column += h) add(name, column, fcn.w1 + column, fcn.inputs);
  }
  add_tables();
  tile_sources_ = Buffer<TileSource>(Device::cuda, 0);
  tile_sources_.upload(sources);
  tiles_ = Buffer<uint16_t>(Device::cuda, sources.size() * tile_numbers);
  tables_on_device_ = Buffer<OffsetTable>(Device::cuda, 0);
  tables_on_device_.upload(table_sources_);
  tables_ = Buffer<float>(Device::cuda, table_sources_.size() * most_table_rows * h);
}

void PackedHgn::add_tables() {
  const auto add = [&](const std::string& name, const OffsetTable& table) {
    table_of_[name] = static_cast<int64_t>(table_sources_.size());
    table_sources_.push_back(table);
  };
  // The offset of a link is the last input of its gather; W_o offset for each of the few offsets that there are.
  for (const PlanOperation& op : plan_.operations) {
    if (op.kind != operation::gather || !op.offset) continue;
    const PlanLayer& layer = plan_.layers[static_cast<std::size_t>(op.layer)];
    const DeviceFcn& net = fcn(layer.name);
    const LinkKind kind = op.links.kind;
    const bool up = kind == LinkKind::cell_to_particle || kind == LinkKind::from_parent;
    const Offsets offsets = kind == LinkKind::cell_neighbors                               ? Offsets::slot
                            : kind == LinkKind::to_parent || kind == LinkKind::from_parent ? Offsets::octant
                                                                                           : Offsets::corner;
    add(layer.name, {offsets, up ? -1.0f : 1.0f, net.w1 + layer.inputs - op.links.offset(), net.inputs,
                     offsets == Offsets::octant ? net.b1 : nullptr, nullptr, 0});
  }
  const DeviceFcn& encoder = fcn("encoder");
  add("encoder", {Offsets::embedding, 1, encoder.w1 + (config_.input_width() - config_.embedding), encoder.inputs,
                  encoder.b1, embedding_, static_cast<int32_t>(config_.embedding)});
}

void PackedHgn::refresh(void* stream) {
  pack_tiles(static_cast<int>(tile_sources_.size()), tile_sources_.data(), tiles_.data(), stream);
  make_tables(static_cast<int>(tables_on_device_.size()), tables_on_device_.data(), tables_.data(), stream);
}

const uint16_t* PackedHgn::tile(const std::string& fcn, int64_t first_column) const {
  return tiles_.data() + tile_of_.at({fcn, first_column}) * tile_numbers;
}

const float* PackedHgn::table(const std::string& fcn) const {
  return tables_.data() + table_of_.at(fcn) * most_table_rows * h;
}

FusedMlp PackedHgn::network(const std::string& name, int64_t rows, const int32_t* row_count) const {
  const DeviceFcn& net = fcn(name);
  FusedMlp network;
  network.rows = rows;
  network.row_count = row_count;
  network.w2 = tile(name, second);
  network.b2 = net.b2;
  network.gamma = net.gamma;
  network.beta = net.beta;
  return network;
}

RowLatents encode_particles(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, FusedMlp& encoder,
                            void* stream) {
  const int64_t n = graph.particles;
  const DeviceFcn& fcn = network.fcn("encoder");
  float* const first = memory.rows32(n);
  encode_features({.rows = n,
                   .features = graph.features,
                   .width = static_cast<int>(network.config().input_width() - network.config().embedding),
                   .w1 = fcn.w1,
                   .stride = fcn.inputs,
                   .type_row = graph.type_row,
                   .type_table = network.table("encoder"),
                   .out = first},
                  stream);
  const RowLatents particles{memory.rows32(n), memory.rows16(n)};
  encoder = network.network("encoder", n);
  encoder.table[0] = {first, {}};
  encoder.sum32 = particles.f32;
  encoder.copy16 = particles.f16;
  forward(encoder, stream);
  return particles;
}

FusedMlp prolongation(const PackedHgn& network, std::size_t l, const LevelLinks& level, const RowLatents& coarse,
                      const RowLatents& fine, const RowLatents& refined) {
  const std::string name = numbered("prolong", static_cast<int64_t>(l));
  FusedMlp way = network.network(name, level.cells, level.cell_count);
  way.operand[0] = {.rows = coarse.f16, .index = level.parent, .weight = network.tile(name, 0)};
  way.operand[1] = {.rows = fine.f16, .weight = network.tile(name, h)};
  way.table[0] = {network.table(name), {level.octant}};
  way.add32 = fine.f32;
  way.sum32 = refined.f32;
  way.copy16 = refined.f16;
  return way;
}

}  // namespace graupel::graph
