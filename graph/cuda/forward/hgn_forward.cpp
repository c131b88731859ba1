#include "graph/cuda/forward/hgn_forward.h"

#include "core/system/error.h"
#include "graph/features/features.h"

namespace graupel::graph {

namespace {

constexpr int corners = 8;
constexpr int64_t h = layer_width;
constexpr int64_t second = -1;  ///< stands for W2 among the columns of W1

/// Row r of a [pairs, .] array belongs to particle r / 8 and corner r % 8.
constexpr RowOf by_particle{nullptr, 3, -1};
constexpr RowOf by_corner{nullptr, 0, corners - 1};
constexpr RowOf always_first{nullptr, 0, 0};

/// W_s f_s, and W_r f_r with the bias, of the first layer of an edge network, [cells].
struct Projections {
  float *sender = nullptr, *receiver = nullptr;
};

/// Results of one iteration of message passing.
struct IterationRows {
  Projections projections;
  uint16_t *message, *latent;  ///< [edges]
  RowLatents nodes;            ///< [cells]
};

class ForwardPass {
 public:
  ForwardPass(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, HgnRecord& record, void* stream)
      : network_(network), graph_(graph), memory_(memory), record_(record), stream_(stream) {}

  float* run(const std::function<void()>& grid_ready);

 private:
  RowLatents latents(int64_t rows) { return {memory_.rows32(rows), memory_.rows16(rows)}; }
  RowLatents particle_to_grid();
  float* grid_to_particle(const RowLatents& cells);
  Projections projections(const LevelLinks& level) {
    return {memory_.rows32(level.cells), memory_.rows32(level.cells)};
  }
  /// Where nothing is kept, networks make their rows' projections for the iteration that comes next.
  bool looks_ahead() const { return !memory_.keeps_all() && can_look_ahead(); }
  RowOutlook outlook(const std::string& edge_name, const Projections& to) const {
    return {{network_.tile(edge_name, 0), network_.tile(edge_name, h)},
            {nullptr, network_.fcn(edge_name).b1},
            {to.sender, to.receiver}};
  }
  /// `ready`: the first iteration's projections where they are there already.
  RowLatents pass_messages(const std::string& block, const LevelLinks& level, RowLatents nodes,
                           HgnRecord::Block& record, const Projections& ready = {});
  RowLatents restrict_to_coarse(std::size_t l, const RowLatents& fine);
  RowLatents prolong_to_fine(std::size_t l, const RowLatents& coarse, const RowLatents& fine, Projections& ahead);

  const PackedHgn& network_;
  const HgnGraph& graph_;
  RowMemory& memory_;
  HgnRecord& record_;
  void* stream_;
};

float* ForwardPass::run(const std::function<void()>& grid_ready) {
  const auto levels = static_cast<std::size_t>(network_.config().levels);
  GRAUPEL_ASSERT(graph_.level.size() == levels);
  record_ = {};
  record_.down.resize(levels);
  record_.up.resize(levels);
  record_.restriction.resize(levels);
  record_.prolongation.resize(levels);
  record_.particles = encode_particles(network_, graph_, memory_, record_.encoder, stream_);
  if (grid_ready) grid_ready();
  std::vector<RowLatents> f(levels);
  f[0] = particle_to_grid();
  for (std::size_t l = 0; l < levels; ++l) {
    f[l] = pass_messages(numbered("down", static_cast<int64_t>(l)), graph_.level[l], f[l], record_.down[l]);
    if (l + 1 < levels) f[l + 1] = restrict_to_coarse(l, f[l]);
  }
  for (std::size_t l = levels - 1; l-- > 0;) {
    Projections ahead;
    const RowLatents refined = prolong_to_fine(l, f[l + 1], f[l], ahead);
    f[l] = pass_messages(numbered("up", static_cast<int64_t>(l)), graph_.level[l], refined, record_.up[l], ahead);
  }
  return grid_to_particle(f[0]);
}

RowLatents ForwardPass::particle_to_grid() {
  // Layer 1 of pair (i, k), to the grid: W_f f_i + b - W_o offset_i + W_o bits_k; from it: W_c f_cell + W_p f_i + b +
  // W_o offset_i - W_o bits_k. Both networks' parts of a particle are made at once.
  const int64_t n = graph_.particles, pairs = corners * n, cells = graph_.level[0].cells;
  const FcnWeights &to = network_.fcn("particle_to_grid"), &from = network_.fcn("grid_to_particle");
  float *const to_particle = memory_.rows32(n), *const from_particle = memory_.rows32(n);
  project({.rows = n,
           .row_count = graph_.particle_count,
           .x = record_.particles.f16,
           .weight = {network_.tile("particle_to_grid", 0), network_.tile("grid_to_particle", h)},
           .bias = {to.b1, from.b1},
           .offset = graph_.offset,
           .offset_weight = {to.w1 + h, from.w1 + 2 * h},
           .offset_stride = {to.inputs, from.inputs},
           .offset_sign = {-1, 1},
           .out = {to_particle, from_particle}},
          stream_);
  RowNetwork& to_grid = record_.to_grid = network_.network("particle_to_grid", pairs, graph_.pair_count);
  to_grid.table[0] = {to_particle, by_particle};
  to_grid.table[1] = {network_.table("particle_to_grid"), by_corner};
  to_grid.out16 = memory_.rows16(pairs);
  record_.to_particle = network_.network("grid_to_particle", pairs, graph_.pair_count);
  record_.to_particle.table[0] = {from_particle, by_particle};
  record_.to_particle.table[1] = {network_.table("grid_to_particle"), by_corner};
  forward(to_grid, stream_);
  const RowLatents sums = latents(cells);
  sum_segments({.segments = cells,
                .row_count = graph_.level[0].cell_count,
                .begin = graph_.pair_begin,
                .item = graph_.pair,
                .are_long = true,
                .source = to_grid.out16,
                .weight = graph_.weight,
                .scale = static_cast<float>(network_.config().p2g_scale),
                .out32 = sums.f32,
                .out16 = sums.f16},
               stream_);
  return sums;
}

float* ForwardPass::grid_to_particle(const RowLatents& cells) {
  const int64_t n = graph_.particles, n_cells = graph_.level[0].cells;
  float* const per_cell = memory_.rows32(n_cells);
  project({.rows = n_cells,
           .row_count = graph_.level[0].cell_count,
           .x = cells.f16,
           .weight = {network_.tile("grid_to_particle", 0)},
           .out = {per_cell}},
          stream_);
  RowNetwork& network = record_.to_particle;
  network.table[2] = {per_cell, {graph_.cell}};
  float* const sums = memory_.rows32(n);
  network.group_weight = graph_.weight;
  network.group_add32 = record_.particles.f32;
  network.group32 = sums;
  forward(network, stream_);
  record_.finest = cells.f16;
  return sums;
}

RowLatents ForwardPass::restrict_to_coarse(std::size_t l, const RowLatents& fine) {
  const LevelLinks& level = graph_.level[l];
  const std::string name = numbered("restrict", static_cast<int64_t>(l));
  RowNetwork& network = record_.restriction[l] = network_.network(name, level.cells, level.cell_count);
  network.operand[0] = {.rows = fine.f16, .weight = network_.tile(name, 0)};
  network.table[0] = {network_.table(name), {level.octant}};
  network.out16 = memory_.rows16(level.cells);
  forward(network, stream_);
  const int64_t parents = graph_.level[l + 1].cells;
  const RowLatents coarse = latents(parents);
  sum_segments({.segments = parents,
                .row_count = graph_.level[l + 1].cell_count,
                .begin = level.child_begin,
                .first = level.first_child,
                .item = level.child,
                .source = network.out16,
                .out32 = coarse.f32,
                .out16 = coarse.f16},
               stream_);
  return coarse;
}

RowLatents ForwardPass::prolong_to_fine(std::size_t l, const RowLatents& coarse, const RowLatents& fine,
                                        Projections& ahead) {
  const LevelLinks& level = graph_.level[l];
  const RowLatents refined = latents(level.cells);
  RowNetwork& network = record_.prolongation[l] = prolongation(network_, l, level, coarse, fine, refined);
  if (looks_ahead()) {
    ahead = projections(level);
    network.outlook = outlook(numbered(numbered("up", static_cast<int64_t>(l)), 0, ".edge"), ahead);
  }
  forward(network, stream_);
  return refined;
}

RowLatents ForwardPass::pass_messages(const std::string& block, const LevelLinks& level, RowLatents nodes,
                                      HgnRecord::Block& record, const Projections& ready) {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e; e is the unit vector at first, the edge latent after.
  const int64_t iterations = network_.config().message_passing;
  std::vector<IterationRows> all;
  const auto rows_of = [&](int64_t k) -> IterationRows& {
    const bool keeps = memory_.keeps_all(), passes_on = k > 0 && k + 1 < iterations;
    const auto place = static_cast<std::size_t>(keeps ? k : k % 2);
    if (place == all.size())
      all.push_back({projections(level), memory_.rows16(level.edges),
                     keeps && !passes_on ? nullptr : memory_.rows16(level.edges), latents(level.cells)});
    return all[place];
  };
  uint16_t* latent = nullptr;
  Projections projected = ready;
  for (int64_t k = 0; k < iterations; ++k) {
    const std::string edge_name = numbered(block, k, ".edge");
    const std::string cell_name = numbered(block, k, ".cell");
    HgnRecord::Iteration& iteration = record.emplace_back();
    const IterationRows own = rows_of(k);
    if (projected.sender == nullptr) {
      projected = own.projections;
      const RowOutlook wanted = outlook(edge_name, projected);
      project({.rows = level.cells,
               .row_count = level.cell_count,
               .x = nodes.f16,
               .weight = {wanted.weight[0], wanted.weight[1]},
               .bias = {wanted.bias[0], wanted.bias[1]},
               .out = {wanted.out[0], wanted.out[1]}},
              stream_);
    }
    RowNetwork& edge = iteration.edge = network_.network(edge_name, level.edges, level.edge_count);
    edge.table[0] = {projected.sender, {level.sender}};
    edge.table[1] = {projected.receiver, {level.receiver}};
    edge.out16 = own.message;
    uint16_t* next_latent = edge.out16;
    if (k == 0) {
      edge.table[2] = {network_.table(edge_name), {level.slot}};
    } else {
      edge.operand[0] = {.rows = latent, .weight = network_.tile(edge_name, 2 * h)};
      if (k + 1 < iterations) {
        next_latent = own.latent;
        edge.add16 = latent;
        edge.sum16 = next_latent;
      }
    }
    forward(edge, stream_);
    latent = next_latent;

    RowNetwork& cell = iteration.cell = network_.network(cell_name, level.cells, level.cell_count);
    cell.operand[0] = {.rows = edge.out16,
                       .begin = level.edge_begin,
                       .first = level.first_edge,
                       .weight = network_.tile(cell_name, 0)};
    cell.operand[1] = {.rows = nodes.f16, .weight = network_.tile(cell_name, h)};
    cell.table[0] = {network_.fcn(cell_name).b1, always_first};
    cell.add32 = nodes.f32;
    cell.sum32 = own.nodes.f32;
    cell.copy16 = own.nodes.f16;
    projected = {};
    if (looks_ahead() && k + 1 < iterations) {
      projected = rows_of(k + 1).projections;
      cell.outlook = outlook(numbered(block, k + 1, ".edge"), projected);
    }
    forward(cell, stream_);
    nodes = own.nodes;
  }
  return nodes;
}

}  // namespace

bool PackedHgn::fits(const HgnConfig& config) { return config.latent == h && config.input_width() <= h; }

PackedHgn::PackedHgn(const HgnConfig& config, std::map<std::string, FcnWeights> fcns, const float* embedding)
    : config_(config), fcns_(std::move(fcns)), embedding_(embedding) {
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
  const auto add = [&](const std::string& name, Offsets offsets, float sign, int64_t column, bool with_bias) {
    const FcnWeights& net = fcn(name);
    table_of_[name] = static_cast<int64_t>(table_sources_.size());
    table_sources_.push_back({offsets, sign, net.w1 + column, net.inputs, with_bias ? net.b1 : nullptr, nullptr, 0});
  };
  const bool sums_activations = config_.aggregation == Aggregation::activations;
  const std::string gather = sums_activations ? ".gather" : "";  // the layer that takes the offset
  const auto add_block = [&](const char* way, int64_t l) {
    const std::string block = numbered(way, l);
    const int64_t iterations = sums_activations ? config_.message_passing : 1;
    for (int64_t k = 0; k < iterations; ++k)
      add(numbered(block, k, sums_activations ? ".gather" : ".edge"), Offsets::slot, 1, 2 * h, false);
  };
  add("particle_to_grid" + gather, Offsets::corner, 1, h, false);
  add("grid_to_particle" + gather, Offsets::corner, -1, 2 * h, false);
  for (int64_t l = 0; l < config_.levels; ++l) {
    add_block("down", l);
    if (l + 1 == config_.levels) break;
    add_block("up", l);
    add(numbered("restrict", l) + gather, Offsets::octant, 1, h, true);
    add(numbered("prolong", l), Offsets::octant, -1, 2 * h, true);
  }
  const FcnWeights& encoder = fcn("encoder");
  table_of_["encoder"] = static_cast<int64_t>(table_sources_.size());
  table_sources_.push_back({Offsets::embedding, 1, encoder.w1 + (config_.input_width() - config_.embedding),
                            encoder.inputs, encoder.b1, embedding_, static_cast<int32_t>(config_.embedding)});
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

RowNetwork PackedHgn::network(const std::string& name, int64_t rows, const int32_t* row_count) const {
  const FcnWeights& net = fcn(name);
  RowNetwork network;
  network.rows = rows;
  network.row_count = row_count;
  network.w2 = tile(name, second);
  network.b2 = net.b2;
  network.gamma = net.gamma;
  network.beta = net.beta;
  return network;
}

RowLatents encode_particles(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, RowNetwork& encoder,
                            void* stream) {
  const int64_t n = graph.particles;
  const FcnWeights& fcn = network.fcn("encoder");
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

RowNetwork prolongation(const PackedHgn& network, std::size_t l, const LevelLinks& level, const RowLatents& coarse,
                        const RowLatents& fine, const RowLatents& refined) {
  const std::string name = numbered("prolong", static_cast<int64_t>(l));
  RowNetwork way = network.network(name, level.cells, level.cell_count);
  way.operand[0] = {.rows = coarse.f16, .index = level.parent, .weight = network.tile(name, 0)};
  way.operand[1] = {.rows = fine.f16, .weight = network.tile(name, h)};
  way.table[0] = {network.table(name), {level.octant}};
  way.add32 = fine.f32;
  way.sum32 = refined.f32;
  way.copy16 = refined.f16;
  return way;
}

float* forward_to_decoder(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, HgnRecord& record,
                          void* stream, const std::function<void()>& grid_ready) {
  return ForwardPass(network, graph, memory, record, stream).run(grid_ready);
}

}  // namespace graupel::graph
