// W1 [f_i, f_j, e] is taken apart: sender and receiver parts are computed once a cell, right after the cell was
// updated, for the next iteration. Edges are stored by receiver, so a tile of cells owns its edges and sums them
// without conflicts.
#include "graph/cpu/messages/message_passing.h"

#include <utility>

#include "graph/topology/offset_tables.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

/// Cells [begin, end) and everything that their update reads and writes.
struct MessagePassing::Tile {
  const LevelTopology& topology;
  int32_t begin, end;
  float* cell;              ///< [cells][H]
  float* edge;              ///< [edges][H]
  const float* projection;  ///< [cells][3 H]
  TileScratch& scratch;

  int32_t first_edge(int32_t c) const { return topology.edges_in.begin[static_cast<std::size_t>(c)]; }
};

MessagePassing::MessagePassing(const nn::Weights& weights, const HgnConfig& config, const std::string& block)
    : width_(nn::padded_width(static_cast<int>(config.latent))) {
  const int h = static_cast<int>(config.latent);
  for (int k = 0; k < config.message_passing; ++k) {
    const std::string prefix = block + "." + std::to_string(k);
    const FcnWeights edge = FcnWeights::load(weights, prefix + ".edge", 2 * h + (k == 0 ? 3 : h), h, h);
    const FcnWeights cell = FcnWeights::load(weights, prefix + ".cell", 2 * h, h, h);
    Iteration iteration;
    iteration.projection =
        nn::StackedLinear(h, {{&edge, 0, Bias::without}, {&edge, h, Bias::with}, {&cell, h, Bias::with}});
    if (k == 0)
      iteration.direction = nn::InputTable(edge, 2 * h, slot_directions());
    else
      iteration.edge_part = edge.first_layer_part(2 * h, h, Bias::without);
    iteration.edge_second = nn::NormalizedLayer(edge);
    iteration.message_part = cell.first_layer_part(0, h, Bias::without);
    iteration.cell_second = nn::NormalizedLayer(cell);
    iterations_.push_back(std::move(iteration));
  }
}

void MessagePassing::apply(std::size_t level, Workspace& workspace) const {
  const LevelTopology& topology = workspace.topology.levels[level];
  float* now = workspace.projection[0].data();
  float* next = workspace.projection[1].data();
  const auto tile_of = [&](int32_t begin, int32_t end, TileScratch& scratch) {
    return Tile{topology, begin, end, workspace.cell[level].data(), workspace.edge.data(), now, scratch};
  };
  for_each_tile(workspace, topology.edge_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    project(iterations_[0], tile_of(begin, end, scratch), now);
  });
  for (std::size_t k = 0; k < iterations_.size(); ++k) {
    for_each_tile(workspace, topology.edge_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      const Tile tile = tile_of(begin, end, scratch);
      update_edges(k, tile);
      update_cells(iterations_[k], tile);
      if (k + 1 < iterations_.size()) project(iterations_[k + 1], tile, next);
    });
    std::swap(now, next);
  }
}

void MessagePassing::project(const Iteration& iteration, const Tile& tile, float* projection) const {
  iteration.projection.linear().apply(tile.cell + static_cast<int64_t>(tile.begin) * width_, width_,
                                      tile.end - tile.begin, projection + static_cast<int64_t>(tile.begin) * 3 * width_,
                                      3 * width_);
}

/// Leaves the sums of the messages in scratch.sums. The edge latents are not stored in the last iteration.
void MessagePassing::update_edges(std::size_t k, const Tile& tile) const {
  const Iteration& iteration = iterations_[k];
  const bool store = k + 1 < iterations_.size();
  const int32_t first = tile.first_edge(tile.begin), rows = tile.first_edge(tile.end) - first;
  const Edge* edges = tile.topology.edges.data() + first;
  float* state = tile.edge + static_cast<int64_t>(first) * width_;
  float* hidden = tile.scratch.hidden.data();
  float* output = tile.scratch.output.data();
  if (k > 0) iteration.edge_part.apply(state, width_, rows, hidden, width_);
  for (int32_t c = tile.begin; c < tile.end; ++c) {
    const float* receiver = tile.projection + (static_cast<int64_t>(c) * 3 + 1) * width_;
    for (int32_t r = tile.first_edge(c) - first; r < tile.first_edge(c + 1) - first; ++r) {
      const float* sender = tile.projection + static_cast<int64_t>(edges[r].sender) * 3 * width_;
      float* row = hidden + r * width_;
      nn::activate_sum(row, sender, receiver, k == 0 ? iteration.direction.row(edges[r].direction) : row, width_);
    }
  }
  iteration.edge_second.apply(hidden, rows, output);
  const float* gamma = iteration.edge_second.gamma();
  const float* beta = iteration.edge_second.beta();
  for (int32_t c = tile.begin; c < tile.end; ++c) {
    float* sum = tile.scratch.sums.data() + (c - tile.begin) * width_;
    nn::clear_row(sum, width_);
    for (int32_t r = tile.first_edge(c) - first; r < tile.first_edge(c + 1) - first; ++r) {
      const float* y = output + r * width_;
      float* e = state + static_cast<int64_t>(r) * width_;
      const float scale = iteration.edge_second.scale(y);
      nn::add_scaled_row(sum, scale, y, width_);
      if (store && k == 0) iteration.edge_second.finish(e, y, scale);
      if (store && k > 0) iteration.edge_second.add_to(e, y, scale);
    }
    const auto count = static_cast<float>(tile.first_edge(c + 1) - tile.first_edge(c));
    nn::scale_sum(sum, 1, gamma, count, beta, width_);
  }
}

void MessagePassing::update_cells(const Iteration& iteration, const Tile& tile) const {
  const int32_t rows = tile.end - tile.begin;
  float* hidden = tile.scratch.hidden.data();
  float* output = tile.scratch.output.data();
  iteration.message_part.apply(tile.scratch.sums.data(), width_, rows, hidden, width_);
  for (int32_t r = 0; r < rows; ++r) {
    float* row = hidden + r * width_;
    nn::activate_sum(row, row, tile.projection + (static_cast<int64_t>(tile.begin + r) * 3 + 2) * width_, width_);
  }
  iteration.cell_second.apply(hidden, rows, output);
  for (int32_t r = 0; r < rows; ++r)
    iteration.cell_second.add_to(tile.cell + static_cast<int64_t>(tile.begin + r) * width_, output + r * width_);
}

}  // namespace graupel::graph
