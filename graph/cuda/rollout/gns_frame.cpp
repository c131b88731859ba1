#include "graph/cuda/rollout/gns_frame.h"

#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "graph/networks/graph_network.h"

namespace graupel::graph {

namespace {

GnsConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(GraphNetwork(weights));  // its errors
  const GnsConfig config = GnsConfig::from_metadata(weights.metadata, weights.file);
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use device 'cpu'");
  if (!PackedNetwork::fits(plan_of(config)))
    throw ConfigError("'" + weights.file + "': networks run on a GPU with a latent width of " +
                      std::to_string(layer_width) +
                      " and one hidden layer only (gns.latent: " + std::to_string(config.latent) +
                      ", gns.hidden_layers: " + std::to_string(config.hidden_layers) + "). Use device 'cpu'");
  return config;
}

}  // namespace

GnsFrame::GnsFrame(const nn::Weights& weights)
    : config_(checked_config(weights)),
      rules_(config_, read_normalization(weights)),
      weights_(weights),
      network_(plan_of(config_), std::cref(weights_)) {
  network_.refresh(nullptr);
}

void GnsFrame::start(const std::vector<Range>& scenes, const std::vector<int32_t>& type_row, void* stream) {
  GRAUPEL_ASSERT(scenes.size() == 1);
  const Range& range = scenes.front();
  particles_ = static_cast<int64_t>(type_row.size());
  std::vector<Vec3f> points;
  const bool with_points = config_.obstacle_particles && range.environment != nullptr;
  if (with_points) points = range.environment->obstacle_particles.at_spacing(config_.obstacle_spacing);
  point_.upload(points);
  builder_.prepare({{range.low, range.high, particles_, point_.data(), static_cast<int64_t>(points.size()), AxisMap{},
                     with_points ? range.environment->view(Device::cuda) : EnvironmentView{}}},
                   stream);
  const auto nodes = static_cast<std::size_t>(builder_.most_nodes());
  std::vector<int32_t> types = type_row;
  types.resize(nodes, embedding_row(obstacle_particle_type));
  type_row_.upload(types);
  position_.resize_discard(nodes);
  features_.resize_discard(nodes * static_cast<std::size_t>(rules_.width));
  output_.resize_discard(static_cast<std::size_t>(config_.output_width()) * type_row.size());
}

void GnsFrame::launch_graph(void* stream, bool with_counts) {
  is_due_ = !with_counts;
  if (with_counts) make_graph(stream);
}

void GnsFrame::make_graph(void* stream) {
  stream_ = stream;
  builder_.build(position_.data(), stream);
  builder_.describe_obstacles(rules_, features_.data(), type_row_.data(), stream);
}

FrameModel::CapacityStatus GnsFrame::ensure_capacity() {
  constexpr double spare = 0.5;  // for frames to come
  const int64_t capacity = builder_.capacity();
  builder_.finish(spare, stream_);
  const auto rows = static_cast<std::size_t>(builder_.capacity() * layer_width);
  latent_.resize_discard(rows);
  message_.resize_discard(rows);
  return builder_.capacity() == capacity ? CapacityStatus::sufficient : CapacityStatus::reallocated;
}

void GnsFrame::launch(void* stream, const LaunchHooks& moments) {
  moments.room_beside();
  if (is_due_) make_graph(stream);
  is_due_ = false;
  moments.graph_ready();
  const RadiusLinks links = builder_.links();
  NetworkGraph graph;
  graph.particles = builder_.most_nodes();
  graph.features = features_.data();
  graph.type_row = type_row_.data();
  graph.edge_features = links.features;
  LevelLinks& edges = graph.level.emplace_back();
  edges.cells = graph.particles;
  edges.edges = builder_.capacity();
  edges.cell_count = links.node_count;
  edges.edge_count = links.edge_count;
  edges.edge_begin = links.begin;
  edges.sender = links.sender;
  edges.receiver = links.receiver;
  Decoder decoder = network_.decoder();
  decoder.rows = particles_;
  decoder.x = forward_messages(network_, graph, arena_, this, record_, stream);
  decoder.out = output_.data();
  decode(decoder, stream);
}

}  // namespace graupel::graph
