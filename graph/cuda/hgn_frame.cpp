#include "graph/cuda/hgn_frame.h"

#include "core/cuda_check.h"
#include "core/error.h"
#include "graph/hierarchical_graph_network.h"

namespace graupel::graph {

namespace {

HgnConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(HierarchicalGraphNetwork(weights));  // its errors
  const HgnConfig config = HgnConfig::from_metadata(weights.metadata, weights.file);
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use --device cpu");
  if (!PackedHgn::fits(config) || config.aggregation != Aggregation::messages)
    throw ConfigError("'" + weights.file + "': networks run on a GPU with a latent width of " +
                      std::to_string(layer_width) +
                      " and sums of messages only (hgn.latent: " + std::to_string(config.latent) +
                      ", hgn.aggregation: " + word_of(config.aggregation) + "). Use --device cpu");
  return config;
}

}  // namespace

/// The stream of the grid, beside that of the encoder.
struct HgnFrame::Streams {
  Streams() {
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&grid));
    for (cudaEvent_t* event : {&features_there, &grid_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
  }
  ~Streams() {
    for (cudaEvent_t event : {features_there, grid_there}) cudaEventDestroy(event);
    cudaStreamDestroy(grid);
  }
  Streams(const Streams&) = delete;
  Streams& operator=(const Streams&) = delete;
  cudaStream_t grid = nullptr;
  cudaEvent_t features_there = nullptr, grid_there = nullptr;
};

HgnFrame::HgnFrame(const nn::Weights& weights)
    : config_(checked_config(weights)),
      weights_(weights),
      network_(config_, weights_.fcns(), weights_.get("embedding.weight")),
      builder_(Device::cuda, config_.spacing, static_cast<int>(config_.levels)),
      streams_(std::make_unique<Streams>()) {
  network_.refresh(nullptr);
}
HgnFrame::~HgnFrame() = default;

void HgnFrame::start(const Surroundings& surroundings, const std::vector<int32_t>& type_row, void* stream) {
  room_ = {};
  particles_ = static_cast<int64_t>(type_row.size());
  type_row_.upload(type_row);
  features_.resize_discard(type_row.size() * static_cast<std::size_t>(config_.input_width() - config_.embedding));
  output_.resize_discard(3 * type_row.size());
  position_.resize_discard(type_row.size());
  builder_.prepare({{surroundings.wall_low, surroundings.wall_low, surroundings.wall_high, particles_}}, stream);
}

void HgnFrame::launch_graph(void* stream, bool with_counts) {
  GRAUPEL_CUDA_CHECK(cudaEventRecord(streams_->features_there, static_cast<cudaStream_t>(stream)));
  GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(streams_->grid, streams_->features_there, 0));
  builder_.build(position_.data(), streams_->grid, with_counts);
}

FrameModel::Room HgnFrame::make_room() {
  const GridCounts counts = builder_.counts(streams_->grid);
  if (counts.overflow) return Room::none;
  if (room_.holds(counts)) return Room::there;
  room_ = LevelRoom::for_counts(counts);
  places_.prepare(room_);
  return Room::moved;
}

HgnGraph HgnFrame::placed_graph() const {
  const GridLinks links = builder_.links();
  HgnGraph placed{};
  placed.particles = particles_;
  placed.particle_count = places_.particle_count();
  placed.pair_count = places_.pair_count();
  placed.features = features_.data();
  placed.type_row = type_row_.data();
  placed.weight = links.weight;
  placed.offset = links.offset;
  placed.cell = links.cell;
  placed.pair_begin = links.pair_begin;
  placed.pair = links.pair;
  for (int l = 0; l < room_.levels; ++l) {
    const PlacedLevel from = places_.level(l);
    LevelLinks level{};
    level.cells = room_.cells[static_cast<std::size_t>(l)];
    level.edges = room_.edges[static_cast<std::size_t>(l)];
    level.cell_count = from.cell_count;
    level.edge_count = from.edge_count;
    level.edge_begin = from.edge_begin;
    level.sender = from.sender;
    level.receiver = from.receiver;
    level.slot = from.slot;
    level.parent = from.parent;
    level.octant = from.octant;
    level.child_begin = from.child_begin;
    level.child = from.child;
    placed.level.push_back(level);
  }
  return placed;
}

void HgnFrame::launch(void* stream, const std::function<void()>& graph_ready) {
  places_.place(builder_.links(), particles_, streams_->grid);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(streams_->grid_there, streams_->grid));
  const float* const latents = forward_to_decoder(network_, placed_graph(), arena_, record_, stream, [&] {
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(static_cast<cudaStream_t>(stream), streams_->grid_there, 0));
    graph_ready();
  });
  const FcnWeights& last = network_.fcn("decoder");
  decode({.rows = particles_,
          .x = latents,
          .w1 = network_.tile("decoder", 0),
          .b1 = last.b1,
          .w2 = last.w2,
          .b2 = last.b2,
          .out = output_.data()},
         stream);
}

}  // namespace graupel::graph
