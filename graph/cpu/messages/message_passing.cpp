// W1 [f_i, f_j, e] is taken apart: sender and receiver parts are computed once a node, right after the node was
// updated, for the next iteration. Edges are stored by receiver, so a tile of receivers owns its edges and sums them
// without conflicts, in runs of tile_rows, however many there are.
#include "graph/cpu/messages/message_passing.h"

#include <algorithm>
#include <utility>

#include "graph/cpu/layer_weights.h"
#include "graph/topology/offset_tables.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

/// Receivers [begin, end) and everything that their update reads and writes.
struct MessagePassing::Tile {
  const HostLinks& links;
  int32_t begin, end;
  float* node;              ///< [n][H]
  float* edge;              ///< [edges][H]
  const float* projection;  ///< [n][3 H]
  TileScratch& scratch;

  int32_t first_edge(int32_t r) const { return links.edge_begin[static_cast<std::size_t>(r)]; }
};

MessagePassing::MessagePassing(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block)
    : width_(width_of(plan)), offsets_(block.links.offset() > 0) {
  const std::vector<PlanLayer> layers = plan.layers_of(block);
  slope_ = static_cast<float>(layers.front().slope);
  for (std::size_t k = 0; k < static_cast<std::size_t>(block.iterations); ++k) {
    const FcnWeights edge = load(weights, layers[2 * k]), node = load(weights, layers[2 * k + 1]);
    const int h = edge.out;
    Iteration iteration;
    iteration.projection =
        nn::StackedLinear(h, {{&edge, 0, Bias::without}, {&edge, h, Bias::with}, {&node, h, Bias::with}});
    if (starts_from_offsets(k))
      iteration.direction = nn::InputTable(edge, 2 * h, slot_directions());
    else
      iteration.edge_part = edge.first_layer_part(2 * h, h, Bias::without);
    iteration.edge_middle = nn::MiddleLayers(edge, slope_);
    iteration.edge_last = nn::NormalizedLayer(edge);
    iteration.message_part = node.first_layer_part(0, h, Bias::without);
    iteration.node_middle = nn::MiddleLayers(node, slope_);
    iteration.node_last = nn::NormalizedLayer(node);
    iterations_.push_back(std::move(iteration));
  }
}

void MessagePassing::apply(const HostLinks& links, Buffer<float>& node, Workspace& workspace) const {
  float* current = workspace.projection[0].data();
  float* next = workspace.projection[1].data();
  const auto tile_of = [&](int32_t begin, int32_t end, TileScratch& scratch) {
    return Tile{links, begin, end, node.data(), workspace.edge.data(), current, scratch};
  };
  for_each_tile(workspace, links.edge_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
    project(iterations_[0], tile_of(begin, end, scratch), current);
  });
  for (std::size_t k = 0; k < iterations_.size(); ++k) {
    for_each_tile(workspace, links.edge_tile, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      const Tile tile = tile_of(begin, end, scratch);
      update_edges(k, tile);
      update_nodes(iterations_[k], tile);
      if (k + 1 < iterations_.size()) project(iterations_[k + 1], tile, next);
    });
    std::swap(current, next);
  }
}

void MessagePassing::project(const Iteration& iteration, const Tile& tile, float* projection) const {
  iteration.projection.linear().apply(tile.node + static_cast<int64_t>(tile.begin) * width_, width_,
                                      tile.end - tile.begin, projection + static_cast<int64_t>(tile.begin) * 3 * width_,
                                      3 * width_);
}

/// Leaves the sums of the messages in scratch.sums. The edge latents are not stored in the last iteration.
void MessagePassing::update_edges(std::size_t k, const Tile& tile) const {
  const Iteration& iteration = iterations_[k];
  const bool from_offsets = starts_from_offsets(k), store = k + 1 < iterations_.size();
  float* sums = tile.scratch.sums.data();
  nn::clear_row(sums, (tile.end - tile.begin) * width_);
  for (int32_t run = tile.first_edge(tile.begin); run < tile.first_edge(tile.end); run += tile_rows) {
    const int32_t rows = std::min(tile_rows, tile.first_edge(tile.end) - run);
    const int32_t* sender = tile.links.sender.data() + run;
    const int32_t* receiver = tile.links.receiver.data() + run;
    float* state = tile.edge + static_cast<int64_t>(run) * width_;
    float* hidden = tile.scratch.hidden.data();
    if (!from_offsets) iteration.edge_part.apply(state, width_, rows, hidden, width_);
    for (int32_t r = 0; r < rows; ++r) {
      float* row = hidden + r * width_;
      nn::activate_sum(row, tile.projection + static_cast<int64_t>(sender[r]) * 3 * width_,
                       tile.projection + (static_cast<int64_t>(receiver[r]) * 3 + 1) * width_,
                       from_offsets ? iteration.direction.row(tile.links.slot[static_cast<std::size_t>(run + r)]) : row,
                       width_, slope_);
    }
    hidden = iteration.edge_middle.apply(hidden, tile.scratch.output.data(), rows);
    float* output = hidden == tile.scratch.hidden.data() ? tile.scratch.output.data() : tile.scratch.hidden.data();
    iteration.edge_last.apply(hidden, rows, output);
    for (int32_t r = 0; r < rows; ++r) {
      const float* y = output + r * width_;
      const float scale = iteration.edge_last.scale(y);
      nn::add_scaled_row(sums + (receiver[r] - tile.begin) * width_, scale, y, width_);
      float* e = state + static_cast<int64_t>(r) * width_;
      if (store && from_offsets) iteration.edge_last.finish(e, y, scale);
      if (store && !from_offsets) iteration.edge_last.add_to(e, y, scale);
    }
  }
  for (int32_t c = tile.begin; c < tile.end; ++c) {
    float* sum = sums + (c - tile.begin) * width_;
    const auto count = static_cast<float>(tile.first_edge(c + 1) - tile.first_edge(c));
    nn::scale_sum(sum, 1, iteration.edge_last.gamma(), count, iteration.edge_last.beta(), width_);
  }
}

void MessagePassing::update_nodes(const Iteration& iteration, const Tile& tile) const {
  const int32_t rows = tile.end - tile.begin;
  float* hidden = tile.scratch.hidden.data();
  iteration.message_part.apply(tile.scratch.sums.data(), width_, rows, hidden, width_);
  for (int32_t r = 0; r < rows; ++r) {
    float* row = hidden + r * width_;
    nn::activate_sum(row, row, tile.projection + (static_cast<int64_t>(tile.begin + r) * 3 + 2) * width_, width_,
                     slope_);
  }
  hidden = iteration.node_middle.apply(hidden, tile.scratch.output.data(), rows);
  float* output = hidden == tile.scratch.hidden.data() ? tile.scratch.output.data() : tile.scratch.hidden.data();
  iteration.node_last.apply(hidden, rows, output);
  for (int32_t r = 0; r < rows; ++r)
    iteration.node_last.add_to(tile.node + static_cast<int64_t>(tile.begin + r) * width_, output + r * width_);
}

}  // namespace graupel::graph
