#include "graph/cuda/persistent/persistent_hgn.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"
#include "graph/cuda/persistent/persistent_weights.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

constexpr int64_t h = layer_width;
constexpr int slots = 8;        ///< most rows of a table
constexpr int64_t corners = 8;  ///< pairs a particle
using Offset = std::array<float, 3>;

/// The offsets that few things have (graph/cuda/fused_mlp/row_layers.h, Offsets).
Offset corner(int k) { return {static_cast<float>(k & 1), static_cast<float>(k >> 1 & 1), static_cast<float>(k >> 2)}; }
Offset octant(int k) {
  const Offset bits = corner(k);
  return {0.5f - bits[0], 0.5f - bits[1], 0.5f - bits[2]};
}
Offset neighbor(int k) {
  Offset unit{};
  if (k < 6) unit[static_cast<std::size_t>(k / 2)] = k % 2 == 0 ? 1.0f : -1.0f;
  return unit;
}

std::string numbered(const std::string& block, int64_t l) {
  return std::string(block).append(".").append(std::to_string(l));
}

/// A gathering's linear layer.
struct Layer {
  std::vector<float> weight, bias;
  int64_t inputs;
};

}  // namespace

/// Packs the weights network by network.
class PersistentHgn::Planner {
 public:
  Planner(PersistentHgn& to, const nn::Weights& weights) : to_(to), weights_(weights) {}

  void plan() {
    const LayerPlan plan = plan_of(to_.config_);
    encoder();
    for (std::size_t b = 0; b < plan.blocks.size(); ++b) {
      next_ = b + 1 < plan.blocks.size() ? &plan.blocks[b + 1] : nullptr;
      visit_block(plan, plan.blocks[b], *this);
    }
    if (!to_.has_own_decoder()) decoder();
    to_.tiles_.upload(tiles_);
    to_.tables_.upload(tables_);
    to_.vectors_.upload(vectors_);
  }

  void particle_to_grid(const PlanBlock& block) {
    begin(block.name, Gather::pairs, 1, static_cast<float>(to_.config_.p2g_scale));
    table(gathering(block.name, h + 3), h, 1, corner);
  }
  void restrict_to_coarse(const PlanBlock& block) {
    begin(block.name, Gather::children, 1);
    table(gathering(block.name, h + 3), h, 1, octant);
  }
  void prolong_to_fine(const PlanBlock& block) {
    begin(block.name, Gather::rows, 2, 1, 2 * h + 3);
    now().addend = vectors_.size();
    add_offsets(vectors_, layer(block.name + ".layer1", 2 * h + 3), 2 * h, -1, octant);
  }
  /// The network before its iterations is the last one planned.
  void pass_messages(const PlanBlock& block) {
    for (int64_t k = 0; k < block.iterations; ++k) {
      const std::string iteration = numbered(block.name, k);
      project_for_iteration(iteration);
      begin(iteration + ".cell", Gather::links, 2);
      table(gathering(iteration, 2 * h + 3), 2 * h, 1, neighbor);
    }
    if (next_->links.kind == LinkKind::to_parent) epilogue(gathering(next_->name, h + 3), 0, true);
    if (next_->links.kind == LinkKind::cell_to_particle) epilogue(gathering(next_->name, 2 * h + 3), 0, false);
  }
  void grid_to_particle(const PlanBlock& block) {
    begin(block.name, Gather::corners, 2);
    table(gathering(block.name, 2 * h + 3), 2 * h, -1, corner);
  }

 private:
  Planned& now() { return to_.plan_.back(); }
  Layer layer(const std::string& name, int64_t inputs, int64_t outputs = h) const {
    return {weights_.get(name + ".weight", {outputs, inputs}), weights_.get(name + ".bias", {outputs}), inputs};
  }
  Layer gathering(const std::string& name, int64_t inputs) const { return layer(name + ".gather", inputs); }

  void tile(const Layer& layer, int64_t column) {
    tiles_.resize(tiles_.size() + tile_numbers);
    pack_persistent_tile(layer.weight.data() + column, layer.inputs, h, tiles_.data() + tiles_.size() - tile_numbers);
  }
  void vector(int which, const std::vector<float>& values) {
    std::copy(values.begin(), values.end(), vectors_.begin() + static_cast<std::ptrdiff_t>(now().vectors) + which * h);
  }

  /// A network with its second layer and norm; of an FCN with `inputs`, of which the first `operands` * 128 are rows.
  void begin(const std::string& name, Gather gather, int operands, float scale = 1, int64_t inputs = 0) {
    start(gather, operands, scale);
    const Layer first = layer(name + ".layer1", inputs > 0 ? inputs : operands * h);
    for (int64_t i = 0; i < operands; ++i) tile(first, i * h);
    vector(bias1, first.bias);
    finish(name);
  }
  void start(Gather gather, int operands, float scale = 1) {
    Planned planned;
    planned.network.gather = gather;
    planned.network.operands = operands;
    planned.network.scale = scale;
    planned.tiles = tiles_.size();
    planned.vectors = vectors_.size();
    vectors_.resize(vectors_.size() + vectors_of_network * h);
    to_.plan_.push_back(planned);
  }
  void finish(const std::string& name) {
    const Layer second = layer(name + ".layer2", h);
    tile(second, 0);
    vector(bias2, second.bias);
    vector(norm_scale, weights_.get(name + ".norm.weight", {h}));
    vector(norm_shift, weights_.get(name + ".norm.bias", {h}));
  }
  /// What the next network gathers of this one's rows: columns from `column` on of a gathering's layer.
  void epilogue(const Layer& gathering, int64_t column, bool with_bias) {
    tile(gathering, column);
    if (with_bias) vector(out_bias0 + now().network.epilogues, gathering.bias);
    ++now().network.epilogues;
  }
  void project_for_iteration(const std::string& name) {
    const Layer next = gathering(name, 2 * h + 3);
    epilogue(next, 0, false);
    epilogue(next, h, true);
  }

  template <typename OffsetOf>
  void add_offsets(std::vector<float>& to, const Layer& layer, int64_t column, float sign, const OffsetOf& offset_of) {
    for (int k = 0; k < slots; ++k)
      for (int64_t row = 0; row < h; ++row) {
        float sum = 0;
        for (std::size_t d = 0; d < 3; ++d)
          sum += layer.weight[static_cast<std::size_t>(row * layer.inputs + column) + d] * offset_of(k)[d];
        to.push_back(sign * sum);
      }
  }
  template <typename OffsetOf>
  void table(const Layer& layer, int64_t column, float sign, const OffsetOf& offset_of) {
    now().table = tables_.size();
    add_offsets(tables_, layer, column, sign, offset_of);
  }

  void encoder() {
    const int64_t width = to_.config_.input_width(), features = width - to_.config_.embedding;
    const Layer first = layer("encoder.layer1", width);
    start(Gather::features, feature_tiles(static_cast<int>(features)));
    now().network.width = static_cast<int32_t>(features);
    tiles_.resize(tiles_.size() + static_cast<std::size_t>(now().network.operands) * tile_numbers);
    pack_feature_tiles(first.weight.data(), width, static_cast<int>(features), tiles_.data() + now().tiles);
    vector(bias1, first.bias);
    finish("encoder");
    now().addend = vectors_.size();
    const int64_t types = 9, e = to_.config_.embedding;
    const std::vector<float> embedding = weights_.get("embedding.weight", {types, e});
    for (int64_t t = 0; t < types; ++t)
      for (int64_t row = 0; row < h; ++row) {
        float sum = 0;
        for (int64_t i = 0; i < e; ++i)
          sum += first.weight[static_cast<std::size_t>(row * width + features + i)] *
                 embedding[static_cast<std::size_t>(t * e + i)];
        vectors_.push_back(sum);
      }
    const Layer to_grid = gathering("particle_to_grid", h + 3), from_grid = gathering("grid_to_particle", 2 * h + 3);
    epilogue(to_grid, 0, true);
    epilogue(from_grid, h, true);
    now().offsets = vectors_.size();
    add_axes(to_grid, h, -1);
    add_axes(from_grid, 2 * h, 1);
  }
  void add_axes(const Layer& layer, int64_t column, float sign) {
    for (int64_t d = 0; d < 3; ++d)
      for (int64_t row = 0; row < h; ++row)
        vectors_.push_back(sign * layer.weight[static_cast<std::size_t>(row * layer.inputs + column + d)]);
  }

  void decoder() {
    const Layer first = layer("decoder.layer1", h), second = layer("decoder.layer2", h, 3);
    epilogue(first, 0, true);
    for (int64_t d = 0; d < 3; ++d) {
      const auto row = second.weight.begin() + d * h;
      vector(out_bias1 + static_cast<int>(d), {row, row + h});
      now().network.decoder_bias[d] = second.bias[static_cast<std::size_t>(d)];
    }
  }

  PersistentHgn& to_;
  const nn::Weights& weights_;
  const PlanBlock* next_ = nullptr;  ///< behind the block at hand
  std::vector<uint16_t> tiles_;
  std::vector<float> tables_, vectors_;
};

bool PersistentHgn::fits(const HgnConfig& config) {
  const auto features = static_cast<int>(config.input_width() - config.embedding);
  return config.aggregation == Aggregation::activations && config.latent == h && features <= most_persistent_features;
}

PersistentHgn::PersistentHgn(const HgnConfig& config, const nn::Weights& weights) : config_(config) {
  GRAUPEL_ASSERT(fits(config));
  Planner(*this, weights).plan();
  if (has_own_decoder()) pack_decoder(weights);
  GRAUPEL_ASSERT(plan_.size() <= most_networks);
}

void PersistentHgn::pack_decoder(const nn::Weights& weights) {
  const int64_t outputs = config_.output_width();
  std::vector<float> all;
  const auto add = [&](const std::string& name, const std::vector<int64_t>& shape) {
    const std::vector<float> values = weights.get("decoder." + name, shape);
    all.insert(all.end(), values.begin(), values.end());
  };
  add("layer1.weight", {h, h});
  add("layer1.bias", {h});
  add("layer2.weight", {outputs, h});
  add("layer2.bias", {outputs});
  decoder_.upload(all);
  Buffer<TileSource> source(Device::cuda, 0);
  source.upload({{decoder_.data(), h, h}});
  decoder_tile_.resize_discard(tile_numbers);
  pack_tiles(1, source.data(), decoder_tile_.data(), nullptr);
  GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(nullptr));
}

void PersistentHgn::launch_decoder(void* stream) {
  const float* const b1 = decoder_.data() + h * h;
  decode({.rows = particles_,
          .frames = static_cast<int>(config_.bundle),
          .x = latents_.data(),  // the particles' stand first
          .w1 = decoder_tile_.data(),
          .b1 = b1,
          .w2 = b1 + h,
          .b2 = b1 + h + config_.output_width() * h,
          .out = output_.data()},
         stream);
}

void PersistentHgn::prepare(const GridInputs& inputs) {
  const auto levels = static_cast<std::size_t>(config_.levels);
  const int64_t n = inputs.particles;
  particles_ = n;
  int64_t cells = 0;
  for (std::size_t l = 0; l < levels; ++l) cells += inputs.room.cells[l];
  latents_.resize_discard(static_cast<std::size_t>((n + cells) * h));
  projections_.resize_discard(static_cast<std::size_t>((2 * n + 4 * cells) * h));
  output_.resize_discard(static_cast<std::size_t>(config_.output_width() * n));
  part_sums_.resize_discard(static_cast<std::size_t>(rows_of_pair_aggregation(inputs.room.cells[0], corners * n) * h));
  done_.resize_discard(plan_.size());
  range_.upload({0, static_cast<int32_t>(n), 0});

  float* latent_place = latents_.data();
  uint16_t* projection_place = projections_.data();
  const auto latents = [&](int64_t rows) { return std::exchange(latent_place, latent_place + rows * h); };
  const auto projections = [&](int64_t rows) { return std::exchange(projection_place, projection_place + rows * h); };
  float* const particle_latents = latents(n);
  uint16_t* const to_grid = projections(n);
  uint16_t* const from_grid = projections(n);
  struct Level {
    float* f;
    uint16_t* projected[2][2];  ///< of the iteration that reads, and of the next one
    int turn = 0;
  };
  std::vector<Level> level;
  for (std::size_t l = 0; l < levels; ++l) {
    const int64_t rows = inputs.room.cells[l];
    level.push_back({latents(rows), {{projections(rows), projections(rows)}, {projections(rows), projections(rows)}}});
  }

  std::vector<PersistentLayer> networks;
  most_rows_.clear();
  std::size_t l = 0;  // the level that is worked on
  for (const Planned& planned : plan_) {
    PersistentLayer network = planned.network;
    network.tiles = tiles_.data() + planned.tiles;
    network.vectors = vectors_.data() + planned.vectors;
    if (planned.table != none) network.table = tables_.data() + planned.table;
    if (planned.addend != none) network.addend = vectors_.data() + planned.addend;
    const GridLinks& grid = inputs.grid;
    const bool of_particles = network.gather == Gather::features || network.gather == Gather::corners;
    switch (network.gather) {
      case Gather::features:
        network.rows32 = inputs.features;
        network.addend_row = inputs.type_row;
        network.sum32 = particle_latents;
        network.out[0] = to_grid;
        network.out[1] = from_grid;
        network.offset = {&inputs.position->a[0],
                          {inputs.origin[0], inputs.origin[1], inputs.origin[2]},
                          1 / config_.spacing,
                          vectors_.data() + planned.offsets};
        break;
      case Gather::pairs:
        pair_aggregation_ = {.range = grid.level_begin,
                             .most_cells = static_cast<int32_t>(inputs.room.cells[0]),
                             .overflow = grid.overflow,
                             .begin = grid.pair_begin,
                             .pair = grid.pair,
                             .cell = grid.cell,
                             .weight = grid.weight,
                             .source = to_grid,
                             .table = network.table,
                             .sums = part_sums_.data()};
        network.rows32 = part_sums_.data();
        network.begin = grid.pair_begin;
        break;
      case Gather::links:
        network.source = level[l].projected[level[l].turn][0];
        network.own = level[l].projected[level[l].turn][1];
        network.link = grid.neighbor;
        network.second = network.add32 = level[l].f;
        level[l].turn = 1 - level[l].turn;
        break;
      case Gather::children:
        network.source = level[l].projected[level[l].turn][0];
        network.link = grid.children;
        ++l;
        break;
      case Gather::rows:
        network.rows32 = level[l].f;
        --l;
        network.link = grid.parent;
        network.addend_row = grid.octant;
        network.second = network.add32 = level[l].f;
        break;
      case Gather::corners:
        network.source = level[0].projected[level[0].turn][0];
        network.own = from_grid;
        network.link = grid.cell;
        network.weight = grid.weight;
        network.second = network.add32 = particle_latents;
        if (has_own_decoder())
          network.sum32 = particle_latents;
        else
          network.decoded = output_.data();
        break;
    }
    if (of_particles) {
      network.range = range_.data();
      network.most_rows = static_cast<int32_t>(n);
    } else {
      network.range = grid.level_begin + l;
      network.most_rows = static_cast<int32_t>(inputs.room.cells[l]);
      network.sum32 = level[l].f;
      network.out[0] = level[l].projected[level[l].turn][0];
      network.out[1] = level[l].projected[level[l].turn][1];
    }
    networks.push_back(network);
    most_rows_.push_back(network.most_rows);
  }
  networks_.upload(networks);
  overflow_ = inputs.grid.overflow;
}

void PersistentHgn::follow_grid(void* grid_stream) {
  GRAUPEL_CUDA_CHECK(
      cudaMemsetAsync(done_.data(), 0, done_.size() * sizeof(uint32_t), static_cast<cudaStream_t>(grid_stream)));
}

void PersistentHgn::launch(void* stream, const LaunchHooks& moments) {
  // The encoder runs beside the making of the grid.
  run_networks({networks_.data(), done_.data(), nullptr, nullptr}, {particles_}, stream);
  moments.graph_ready();
  aggregate_pairs(pair_aggregation_, corners * particles_, stream);
  run_networks({networks_.data() + 1, done_.data() + 1, overflow_, range_.data() + 2},
               {most_rows_.begin() + 1, most_rows_.end()}, stream, moments.room_beside);
  if (has_own_decoder()) launch_decoder(stream);
}

}  // namespace graupel::graph
