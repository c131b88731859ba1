// W1 [f_i, f_j, e] is taken apart: sender and receiver parts are computed once a particle, right after it was updated,
// for the next step. Edges are stored by receiver, so a tile of particles owns its edges and sums them without
// conflicts, in runs of tile_rows, however many there are.
#include "graph/cpu/messages/gns_processor.h"

#include <algorithm>
#include <utility>

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {
constexpr int64_t tile_receivers = 16;
}

void GnsWorkspace::prepare(int width, int features) {
  const auto w = static_cast<std::size_t>(width), n = static_cast<std::size_t>(graph.particles());
  node.resize_discard(n * w);
  edge.resize_discard(static_cast<std::size_t>(graph.links.edges()) * w);
  for (auto& buffer : projection) buffer.resize_discard(n * 3 * w);
  prepare_scratch(scratch, width, features);
}

/// Receivers [begin, end) and everything that their update reads and writes.
struct GnsProcessor::Tile {
  const GnsGraph& graph;
  int32_t begin, end;
  float* node;              ///< [n][H]
  float* edge;              ///< [edges][H]
  const float* projection;  ///< [n][3 H]
  TileScratch& scratch;

  int32_t first_edge(int32_t r) const { return graph.links.begin[static_cast<std::size_t>(r)]; }
};

GnsProcessor::GnsProcessor(const nn::Weights& weights, const GnsConfig& config)
    : width_(nn::padded_width(static_cast<int>(config.latent))),
      slope_(static_cast<float>(config.leaky_slope)),
      radius_(config.radius) {
  const int h = static_cast<int>(config.latent), layers = static_cast<int>(config.hidden_layers);
  const auto load = [&](const std::string& name, int inputs) {
    return FcnWeights::load(weights, name, inputs, h, h, nn::Norm::layer, layers);
  };
  const FcnWeights encoder = load("encoder.edge", edge_feature_count);
  encoder_first_ = encoder.first_layer_part(0, edge_feature_count, Bias::with);
  encoder_middle_ = nn::MiddleLayers(encoder, slope_);
  encoder_last_ = nn::NormalizedLayer(encoder);
  for (int k = 0; k < config.message_passing; ++k) {
    const std::string prefix = "step." + std::to_string(k);
    const FcnWeights edge = load(prefix + ".edge", 3 * h), node = load(prefix + ".node", 2 * h);
    Step step;
    step.projection = nn::StackedLinear(h, {{&edge, 0, Bias::without}, {&edge, h, Bias::with}, {&node, h, Bias::with}});
    step.edge_part = edge.first_layer_part(2 * h, h, Bias::without);
    step.edge_middle = nn::MiddleLayers(edge, slope_);
    step.edge_last = nn::NormalizedLayer(edge);
    step.message_part = node.first_layer_part(0, h, Bias::without);
    step.node_middle = nn::MiddleLayers(node, slope_);
    step.node_last = nn::NormalizedLayer(node);
    steps_.push_back(std::move(step));
  }
}

void GnsProcessor::apply(GnsWorkspace& workspace) const {
  const int64_t n = workspace.graph.particles();
  float* now = workspace.projection[0].data();
  float* next = workspace.projection[1].data();
  const auto tile_of = [&](int32_t begin, int32_t end, TileScratch& scratch) {
    return Tile{workspace.graph, begin, end, workspace.node.data(), workspace.edge.data(), now, scratch};
  };
  encode_edges(workspace);
  for_each_range(workspace, n, tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    project(steps_[0], tile_of(begin, end, scratch), now);
  });
  for (std::size_t k = 0; k < steps_.size(); ++k) {
    for_each_range(workspace, n, tile_receivers, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      const Tile tile = tile_of(begin, end, scratch);
      update_edges(k, tile);
      update_nodes(steps_[k], tile);
      if (k + 1 < steps_.size()) project(steps_[k + 1], tile, next);
    });
    std::swap(now, next);
  }
}

void GnsProcessor::encode_edges(GnsWorkspace& workspace) const {
  const GnsGraph& graph = workspace.graph;
  for_each_range(workspace, graph.links.edges(), tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    const int rows = end - begin;
    for (int r = 0; r < rows; ++r) {
      const auto e = static_cast<std::size_t>(begin + r);
      const auto features = edge_features(graph.position[static_cast<std::size_t>(graph.links.sender[e])],
                                          graph.position[static_cast<std::size_t>(graph.receiver[e])], radius_);
      std::copy(features.begin(), features.end(), scratch.input.data() + r * edge_feature_count);
    }
    encoder_first_.apply(scratch.input.data(), edge_feature_count, rows, scratch.hidden.data(), width_);
    for (int r = 0; r < rows; ++r) nn::activate_row(scratch.hidden.data() + r * width_, width_, slope_);
    float* latent = workspace.edge.data() + static_cast<int64_t>(begin) * width_;
    encoder_last_.apply(encoder_middle_.apply(scratch.hidden.data(), scratch.output.data(), rows), rows, latent);
    for (int r = 0; r < rows; ++r) encoder_last_.finish(latent + static_cast<int64_t>(r) * width_);
  });
}

void GnsProcessor::project(const Step& step, const Tile& tile, float* projection) const {
  step.projection.linear().apply(tile.node + static_cast<int64_t>(tile.begin) * width_, width_, tile.end - tile.begin,
                                 projection + static_cast<int64_t>(tile.begin) * 3 * width_, 3 * width_);
}

/// Leaves the sums of the messages in scratch.sums. The edge latents are not stored in the last step.
void GnsProcessor::update_edges(std::size_t k, const Tile& tile) const {
  const Step& step = steps_[k];
  const bool store = k + 1 < steps_.size();
  const float* gamma = step.edge_last.gamma();
  const float* beta = step.edge_last.beta();
  float* sums = tile.scratch.sums.data();
  nn::clear_row(sums, (tile.end - tile.begin) * width_);
  for (int32_t run = tile.first_edge(tile.begin); run < tile.first_edge(tile.end); run += tile_rows) {
    const int32_t rows = std::min(tile_rows, tile.first_edge(tile.end) - run);
    const int32_t* sender = tile.graph.links.sender.data() + run;
    const int32_t* receiver = tile.graph.receiver.data() + run;
    float* state = tile.edge + static_cast<int64_t>(run) * width_;
    float* hidden = tile.scratch.hidden.data();
    step.edge_part.apply(state, width_, rows, hidden, width_);
    for (int32_t r = 0; r < rows; ++r) {
      float* row = hidden + r * width_;
      nn::activate_sum(row, tile.projection + static_cast<int64_t>(sender[r]) * 3 * width_,
                       tile.projection + (static_cast<int64_t>(receiver[r]) * 3 + 1) * width_, row, width_, slope_);
    }
    hidden = step.edge_middle.apply(hidden, tile.scratch.output.data(), rows);
    float* output = hidden == tile.scratch.hidden.data() ? tile.scratch.output.data() : tile.scratch.hidden.data();
    step.edge_last.apply(hidden, rows, output);
    for (int32_t r = 0; r < rows; ++r) {
      const float* y = output + r * width_;
      const float scale = step.edge_last.scale(y);
      nn::add_scaled_row(sums + (receiver[r] - tile.begin) * width_, scale, y, width_);
      float* e = state + static_cast<int64_t>(r) * width_;
      if (store) step.edge_last.add_to(e, y, scale);
    }
  }
  for (int32_t c = tile.begin; c < tile.end; ++c) {
    float* sum = sums + (c - tile.begin) * width_;
    const auto count = static_cast<float>(tile.first_edge(c + 1) - tile.first_edge(c));
    nn::scale_sum(sum, 1, gamma, count, beta, width_);
  }
}

void GnsProcessor::update_nodes(const Step& step, const Tile& tile) const {
  const int32_t rows = tile.end - tile.begin;
  float* hidden = tile.scratch.hidden.data();
  step.message_part.apply(tile.scratch.sums.data(), width_, rows, hidden, width_);
  for (int32_t r = 0; r < rows; ++r) {
    float* row = hidden + r * width_;
    nn::activate_sum(row, row, tile.projection + (static_cast<int64_t>(tile.begin + r) * 3 + 2) * width_, width_,
                     slope_);
  }
  hidden = step.node_middle.apply(hidden, tile.scratch.output.data(), rows);
  float* output = hidden == tile.scratch.hidden.data() ? tile.scratch.output.data() : tile.scratch.hidden.data();
  step.node_last.apply(hidden, rows, output);
  for (int32_t r = 0; r < rows; ++r)
    step.node_last.add_to(tile.node + static_cast<int64_t>(tile.begin + r) * width_, output + r * width_);
}

}  // namespace graupel::graph
