#include "graph/cuda/forward/message_forward.h"

#include <optional>

#include "graph/cuda/forward/forward_pass.h"

namespace graupel::graph {

namespace {

/// Arrays [edges, 128] of a block, whose latents are written where they were read.
class BlockEdges : public EdgeMemory {
 public:
  BlockEdges(RowMemory& memory, int64_t edges) : latent_(memory.rows16(edges)), message_(memory.rows16(edges)) {}
  uint16_t* latent(int64_t) override { return latent_; }
  uint16_t* message() override { return message_; }

 private:
  uint16_t *latent_, *message_;
};

/// What an iteration writes of the nodes.
struct NodeArrays {
  Projections projections;
  RowLatents latents;
  uint16_t* received = nullptr;  ///< sums of messages, where the node network does not gather them itself
};

class MessagePass : public ForwardPass {
 public:
  MessagePass(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, EdgeMemory* edges,
              MessageRecord& record, void* stream)
      : ForwardPass(network, graph, memory, stream), edges_(edges), record_(record) {}

  float* run(const std::function<void()>& graph_ready) {
    record_ = {};
    encode_particles(record_.node_encoder, has_grid() ? nullptr : graph_.level.front().cell_count);
    if (!has_grid()) encode_edges();
    if (graph_ready) graph_ready();
    if (has_grid())
      run_blocks(network_.plan(), *this);
    else
      for (const PlanBlock& block : network_.plan().blocks) pass_messages(block);
    return has_grid() ? result_ : f_.front().f32;
  }

  void particle_to_grid(const PlanBlock& block);
  void pass_messages(const PlanBlock& block);
  void restrict_to_coarse(const PlanBlock& block);
  void prolong_to_fine(const PlanBlock& block) { prolong(block); }
  void grid_to_particle(const PlanBlock& block);

 private:
  bool has_grid() const { return network_.plan().inputs == 1; }  ///< else edges between particles have features
  void encode_edges();
  /// Arrays of iteration k; where not all are kept, those of the iteration before the last.
  NodeArrays& arrays_of(const PlanBlock& block, int64_t k, std::vector<NodeArrays>& all);
  /// Where nothing is kept, node networks make their rows' projections for the iteration that comes next.
  bool projects_ahead() const { return !memory_.keeps_all() && can_project_ahead(); }
  /// A network over pairs, from the particles' parts of its first layer.
  FusedMlp pair_network(const std::string& name, const float* of_particles) const;

  EdgeMemory* edges_;
  MessageRecord& record_;
  const float* from_particle_ = nullptr;  ///< the particles' part of grid_to_particle's first layer
  float* result_ = nullptr;
};

void MessagePass::encode_edges() {
  // Without a grid the nodes of level 0 are the particles.
  f_.front() = particles_;
  const LevelLinks& level = graph_.level.front();
  const std::string& name = network_.plan().layers[1].name;
  const DeviceFcn& fcn = network_.fcn(name);
  FusedMlp& encoder = record_.edge_encoder = network_.network(name, level.edges, level.edge_count);
  encoder.features = {graph_.edge_features, fcn.w1};
  encoder.table[0] = {fcn.b1, always_first};
  encoder.out16 = edges_->latent(0);
  forward(encoder, stream_);
}

FusedMlp MessagePass::pair_network(const std::string& name, const float* of_particles) const {
  FusedMlp network = network_.network(name, corners * graph_.particles, graph_.pair_count);
  network.table[0] = {of_particles, by_particle};
  network.table[1] = {network_.table(name), by_corner};
  return network;
}

void MessagePass::particle_to_grid(const PlanBlock& block) {
  const Projections of_particles = project_particles();
  from_particle_ = of_particles.out[1];
  FusedMlp network = pair_network(block.name, of_particles.out[0]);
  network.out16 = memory_.rows16(network.rows);
  forward(network, stream_);
  const LevelLinks& level = graph_.level[0];
  f_[0] = latents(level.cells);
  sum_segments({.segments = level.cells,
                .row_count = level.cell_count,
                .begin = graph_.pair_begin,
                .item = graph_.pair,
                .are_long = true,
                .source = network.out16,
                .weight = graph_.weight,
                .scale = static_cast<float>(network_.plan().scale_of(block)),
                .out32 = f_[0].f32,
                .out16 = f_[0].f16},
               stream_);
}

void MessagePass::grid_to_particle(const PlanBlock& block) {
  const LevelLinks& level = graph_.level[0];
  float* const per_cell = memory_.rows32(level.cells);
  project({.rows = level.cells,
           .row_count = level.cell_count,
           .x = f_[0].f16,
           .to = {.weight = {network_.tile(block.name, 0)}, .out = {per_cell}}},
          stream_);
  FusedMlp network = pair_network(block.name, from_particle_);
  network.table[2] = {per_cell, {graph_.cell}};
  network.group_weight = graph_.weight;
  network.group_add32 = particles_.f32;
  network.group32 = result_ = memory_.rows32(graph_.particles);
  forward(network, stream_);
}

void MessagePass::restrict_to_coarse(const PlanBlock& block) {
  const LevelLinks &level = graph_.level[block.level()], &above = graph_.level[block.level() + 1];
  FusedMlp network = network_.network(block.name, level.cells, level.cell_count);
  network.operand[0] = {.rows = f_[block.level()].f16, .weight = network_.tile(block.name, 0)};
  network.table[0] = {network_.table(block.name), {level.octant}};
  network.out16 = memory_.rows16(level.cells);
  forward(network, stream_);
  const RowLatents coarse = f_[block.level() + 1] = latents(above.cells);
  sum_segments({.segments = above.cells,
                .row_count = above.cell_count,
                .begin = level.child_begin,
                .first = level.first_child,
                .item = level.child,
                .source = network.out16,
                .out32 = coarse.f32,
                .out16 = coarse.f16},
               stream_);
}

NodeArrays& MessagePass::arrays_of(const PlanBlock& block, int64_t k, std::vector<NodeArrays>& all) {
  const auto place = static_cast<std::size_t>(memory_.keeps_all() ? k : k % 2);
  const int64_t nodes = graph_.level[block.level()].cells;
  const PlanLayer& gather = *layers(block, k).gather;
  if (place == all.size())
    all.push_back({node_projections(gather, nodes), latents(nodes), edges_ ? memory_.rows16(nodes) : nullptr});
  else
    all[place].projections = node_projections(gather, all[place].projections);
  return all[place];
}

void MessagePass::pass_messages(const PlanBlock& block) {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e. Between cells e is the unit vector at first, and the first
  // messages are the edges' first latents; between particles both come from the encoder.
  const LevelLinks& level = graph_.level[block.level()];
  std::optional<BlockEdges> of_block;
  EdgeMemory& edges = edges_ ? *edges_ : of_block.emplace(memory_, level.edges);
  RowLatents& nodes = f_[block.level()];
  std::vector<NodeArrays> all;
  Projections projected = std::exchange(ahead_, {});
  for (int64_t k = 0; k < block.iterations; ++k) {
    const BlockLayers current = layers(block, k);
    const NodeArrays own = arrays_of(block, k, all);
    const bool is_followed = k + 1 < block.iterations;
    if (projected.weight[0] == nullptr) {
      projected = own.projections;
      project_nodes(projected, level, nodes.f16);
    }
    MessageRecord::Step& step = record_.step.emplace_back();
    FusedMlp& edge = step.edge = network_.network(current.gather->name, level.edges, level.edge_count);
    edge.table[0] = {projected.out[0], {level.sender}};
    edge.table[1] = {projected.out[1], {level.receiver}};
    edge.out16 = edges.message();
    if (k == 0 && has_grid()) {
      edge.table[2] = {network_.table(current.gather->name), {level.slot}};
      edge.out16 = edges.latent(1);
    } else {
      edge.operand[0] = {.rows = edges.latent(k), .weight = network_.tile(current.gather->name, 2 * h)};
      if (is_followed) {
        edge.add16 = edges.latent(k);
        edge.sum16 = edges.latent(k + 1);
      }
    }
    forward(edge, stream_);

    RowOperand sum{.rows = edge.out16, .begin = level.edge_begin, .first = level.first_edge};
    if (own.received) {  // tens of messages a node
      sum_segments({.segments = level.cells,
                    .row_count = level.cell_count,
                    .begin = level.edge_begin,
                    .are_long = true,
                    .source = edge.out16,
                    .out16 = own.received},
                   stream_);
      sum = {.rows = own.received};
    }
    step.node = update(*current.update, level.cells, level.cell_count, sum, nodes, own.latents);
    projected = {};
    if (is_followed && projects_ahead()) step.node.epilogue = projected = arrays_of(block, k + 1, all).projections;
    forward(step.node, stream_);
    nodes = own.latents;
  }
}

}  // namespace

float* forward_messages(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, EdgeMemory* edges,
                        MessageRecord& record, void* stream, const std::function<void()>& graph_ready) {
  return MessagePass(network, graph, memory, edges, record, stream).run(graph_ready);
}

}  // namespace graupel::graph
