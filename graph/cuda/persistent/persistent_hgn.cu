#include "graph/cuda/persistent/persistent_hgn.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <string>
#include <utility>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"
#include "graph/cuda/forward/packed_network.h"
#include "graph/cuda/persistent/persistent_weights.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

constexpr int64_t h = layer_width;
constexpr int slots = 8;        ///< most rows of a table
constexpr int64_t corners = 8;  ///< pairs a particle

/// A matrix [outputs, inputs] with its bias.
struct Layer {
  std::vector<float> weight, bias;
  int64_t inputs;
};

}  // namespace

/// Packs the weights network by network.
class PersistentHgn::Planner {
 public:
  Planner(PersistentHgn& to, const nn::Weights& weights) : to_(to), plan_(plan_of(to.config_)), weights_(weights) {}

  void plan() {
    encoder();
    for (const PlanBlock& block : plan_.blocks) visit_block(plan_, block, *this);
    if (!to_.has_own_decoder()) decoder();
    to_.tiles_.upload(tiles_);
    to_.tables_.upload(tables_);
    to_.vectors_.upload(vectors_);
  }

  void particle_to_grid(const PlanBlock& block) { transfer(block, Gather::pairs, 1); }
  void restrict_to_coarse(const PlanBlock& block) { transfer(block, Gather::children, 1); }
  void grid_to_particle(const PlanBlock& block) { transfer(block, Gather::corners, 2); }
  void prolong_to_fine(const PlanBlock& block) {
    const PlanLayer& layer = *layers_of(plan_, block).gather;
    begin(layer, Gather::rows, 2);
    last_planned().addend = vectors_.size();
    add_offsets(vectors_, first_of(layer), block.links.kind);
  }
  /// The network before its iterations is the last one planned.
  void pass_messages(const PlanBlock& block) {
    for (int64_t k = 0; k < block.iterations; ++k) {
      const BlockLayers layers = layers_of(plan_, block, k);
      const Layer gather = first_of(*layers.gather);
      epilogue(gather, 0, false);
      epilogue(gather, h, true);
      begin(*layers.update, Gather::links, 2);
      table(gather, block.links.kind);
    }
    const PlanBlock& next = plan_.blocks[block.number + 1];
    if (next.links.kind != LinkKind::from_parent)
      epilogue(first_of(*layers_of(plan_, next).gather), 0, next.links.kind == LinkKind::to_parent);
  }

 private:
  Planned& last_planned() { return to_.plan_.back(); }
  Layer layer(const std::string& name, int64_t inputs, int64_t outputs) const {
    return {weights_.get(name + ".weight", {outputs, inputs}), weights_.get(name + ".bias", {outputs}), inputs};
  }
  Layer first_of(const PlanLayer& fcn) const {
    return layer(fcn.is_linear() ? fcn.name : fcn.name + ".layer1", fcn.inputs, h);
  }
  Layer second_of(const PlanLayer& fcn) const { return layer(fcn.name + ".layer2", h, fcn.outputs); }

  void tile(const Layer& layer, int64_t column) {
    tiles_.resize(tiles_.size() + tile_numbers);
    pack_persistent_tile(layer.weight.data() + column, layer.inputs, h, tiles_.data() + tiles_.size() - tile_numbers);
  }
  void vector(int which, const std::vector<float>& values) {
    std::copy(values.begin(), values.end(),
              vectors_.begin() + static_cast<std::ptrdiff_t>(last_planned().vectors) + which * h);
  }

  /// The update of what is gathered by a linear layer.
  void transfer(const PlanBlock& block, Gather gather, int operands) {
    const BlockLayers layers = layers_of(plan_, block);
    begin(*layers.update, gather, operands, static_cast<float>(plan_.scale_of(block)));
    table(first_of(*layers.gather), block.links.kind);
  }
  /// A network with its second layer and norm, of whose inputs the first `operands` * 128 are rows.
  void begin(const PlanLayer& layer, Gather gather, int operands, float scale = 1) {
    start(gather, operands, scale);
    const Layer first = first_of(layer);
    for (int64_t i = 0; i < operands; ++i) tile(first, i * h);
    vector(bias1, first.bias);
    finish(layer);
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
  void finish(const PlanLayer& layer) {
    const Layer second = second_of(layer);
    tile(second, 0);
    vector(bias2, second.bias);
    vector(norm_scale, weights_.get(layer.name + ".norm.weight", {h}));
    vector(norm_shift, weights_.get(layer.name + ".norm.bias", {h}));
  }
  /// What the next network gathers of this one's rows: columns from `column` on of a gathering's layer.
  void epilogue(const Layer& gathering, int64_t column, bool with_bias) {
    tile(gathering, column);
    if (with_bias) vector(out_bias0 + last_planned().network.epilogues, gathering.bias);
    ++last_planned().network.epilogues;
  }

  /// W_o offset of the links of a gather, whose last three inputs are the offset.
  void add_offsets(std::vector<float>& to, const Layer& layer, LinkKind links) {
    const LinkOffsets offsets = offsets_of(links);
    for (int k = 0; k < slots; ++k)
      for (int64_t row = 0; row < h; ++row) {
        float sum = 0;
        for (int d = 0; d < 3; ++d)
          sum +=
              layer.weight[static_cast<std::size_t>((row + 1) * layer.inputs - 3 + d)] * offset_of(offsets.kind, k, d);
        to.push_back(offsets.sign * sum);
      }
  }
  void table(const Layer& layer, LinkKind links) {
    last_planned().table = tables_.size();
    add_offsets(tables_, layer, links);
  }

  void encoder() {
    const PlanLayer& layer = plan_.layers.front();
    const int64_t width = layer.inputs, features = width - plan_.embedding;
    const Layer first = first_of(layer);
    start(Gather::features, feature_tiles(static_cast<int>(features)));
    last_planned().network.width = static_cast<int32_t>(features);
    tiles_.resize(tiles_.size() + static_cast<std::size_t>(last_planned().network.operands) * tile_numbers);
    pack_feature_tiles(first.weight.data(), width, static_cast<int>(features), tiles_.data() + last_planned().tiles);
    vector(bias1, first.bias);
    finish(layer);
    last_planned().addend = vectors_.size();
    const int64_t types = 9, e = plan_.embedding;
    const std::vector<float> embedding = weights_.get("embedding.weight", {types, e});
    for (int64_t t = 0; t < types; ++t)
      for (int64_t row = 0; row < h; ++row) {
        float sum = 0;
        for (int64_t i = 0; i < e; ++i)
          sum += first.weight[static_cast<std::size_t>(row * width + features + i)] *
                 embedding[static_cast<std::size_t>(t * e + i)];
        vectors_.push_back(sum);
      }
    const Layer to_grid = first_of(*layers_of(plan_, plan_.blocks.front()).gather),
                from_grid = first_of(*layers_of(plan_, plan_.blocks.back()).gather);
    epilogue(to_grid, 0, true);
    epilogue(from_grid, h, true);
    last_planned().offsets = vectors_.size();
    add_axes(to_grid, h, -1);
    add_axes(from_grid, 2 * h, 1);
  }
  void add_axes(const Layer& layer, int64_t column, float sign) {
    for (int64_t d = 0; d < 3; ++d)
      for (int64_t row = 0; row < h; ++row)
        vectors_.push_back(sign * layer.weight[static_cast<std::size_t>(row * layer.inputs + column + d)]);
  }

  void decoder() {
    const Layer second = second_of(plan_.layers.back());
    epilogue(first_of(plan_.layers.back()), 0, true);
    for (int64_t d = 0; d < 3; ++d) {
      const auto row = second.weight.begin() + d * h;
      vector(out_bias1 + static_cast<int>(d), {row, row + h});
      last_planned().network.decoder_bias[d] = second.bias[static_cast<std::size_t>(d)];
    }
  }

  PersistentHgn& to_;
  const LayerPlan plan_;
  const nn::Weights& weights_;
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
  decoder_.emplace(weights);
  Buffer<TileSource> source(Device::cuda, 0);
  source.upload({{(*decoder_)("decoder.layer1.weight"), h, h}});
  decoder_tile_.resize_discard(tile_numbers);
  pack_tiles(1, source.data(), decoder_tile_.data(), nullptr);
  GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(nullptr));
}

void PersistentHgn::launch_decoder(void* stream) {
  decode({.rows = particles_,
          .frames = static_cast<int>(config_.bundle),
          .x = latents_.data(),  // the particles' stand first
          .w1 = decoder_tile_.data(),
          .b1 = (*decoder_)("decoder.layer1.bias"),
          .w2 = (*decoder_)("decoder.layer2.weight"),
          .b2 = (*decoder_)("decoder.layer2.bias"),
          .out = output_.data()},
         stream);
}

void PersistentHgn::prepare(const GridInputs& inputs) {
  const auto levels = static_cast<std::size_t>(config_.levels);
  const int64_t n = inputs.particles;
  particles_ = n;
  int64_t cells = 0;
  for (std::size_t l = 0; l < levels; ++l) cells += inputs.capacity.cells[l];
  latents_.resize_discard(static_cast<std::size_t>((n + cells) * h));
  projections_.resize_discard(static_cast<std::size_t>((2 * n + 4 * cells) * h));
  output_.resize_discard(static_cast<std::size_t>(config_.output_width() * n));
  const auto scenes = static_cast<int32_t>(inputs.particles_of_scene.size());
  part_sums_.resize_discard(
      static_cast<std::size_t>(rows_of_pair_aggregation(inputs.capacity.cells[0], corners * n, scenes) * h));
  std::vector<int64_t> pairs_of_scene;
  for (const int64_t of_scene : inputs.particles_of_scene) pairs_of_scene.push_back(corners * of_scene);
  part_begins_.upload(begins_of_parts(pairs_of_scene));
  PairParts parts{};
  if (scenes > 1) parts = {scenes, part_begins_.data(), part_begins_.data() + scenes + 1};
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
    int current_buffer = 0;
  };
  std::vector<Level> level;
  for (std::size_t l = 0; l < levels; ++l) {
    const int64_t rows = inputs.capacity.cells[l];
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
                             .most_cells = static_cast<int32_t>(inputs.capacity.cells[0]),
                             .overflow = grid.overflow,
                             .begin = grid.pair_begin,
                             .pair = grid.pair,
                             .cell = grid.cell,
                             .weight = grid.weight,
                             .source = to_grid,
                             .table = network.table,
                             .sums = part_sums_.data(),
                             .parts = parts};
        network.rows32 = part_sums_.data();
        network.begin = grid.pair_begin;
        network.parts = parts;
        break;
      case Gather::links:
        network.source = level[l].projected[level[l].current_buffer][0];
        network.own = level[l].projected[level[l].current_buffer][1];
        network.link = grid.neighbor;
        network.second = network.add32 = level[l].f;
        level[l].current_buffer = 1 - level[l].current_buffer;
        break;
      case Gather::children:
        network.source = level[l].projected[level[l].current_buffer][0];
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
        network.source = level[0].projected[level[0].current_buffer][0];
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
      network.most_rows = static_cast<int32_t>(inputs.capacity.cells[l]);
      network.sum32 = level[l].f;
      network.out[0] = level[l].projected[level[l].current_buffer][0];
      network.out[1] = level[l].projected[level[l].current_buffer][1];
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
