#include "graph/cuda/forward/message_network.h"

namespace graupel::graph {

MessageNetwork::MessageNetwork(const HgnConfig& config, const nn::Weights& weights)
    : weights_(weights), network_(config, weights_.fcns(), weights_.get("embedding.weight")) {
  network_.refresh(nullptr);
}

void MessageNetwork::prepare(const GridInputs& inputs) {
  inputs_ = inputs;
  places_.prepare(inputs.room);
  output_.resize_discard(static_cast<std::size_t>(network_.config().output_width() * inputs.particles));
}

HgnGraph MessageNetwork::graph() const {
  const GridLinks& links = inputs_.grid;
  HgnGraph placed{};
  placed.particles = inputs_.particles;
  placed.particle_count = places_.particle_count();
  placed.pair_count = places_.pair_count();
  placed.features = inputs_.features;
  placed.type_row = inputs_.type_row;
  placed.weight = links.weight;
  placed.offset = links.offset;
  placed.cell = links.cell;
  placed.pair_begin = links.pair_begin;
  placed.pair = links.pair;
  for (int l = 0; l < inputs_.room.levels; ++l) {
    const PlacedLevel from = places_.level(l);
    LevelLinks level{};
    level.cells = inputs_.room.cells[static_cast<std::size_t>(l)];
    level.edges = inputs_.room.edges[static_cast<std::size_t>(l)];
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

void MessageNetwork::follow_grid(void* grid_stream) { places_.place(inputs_.grid, inputs_.particles, grid_stream); }

void MessageNetwork::launch(void* stream, const LaunchMoments& moments) {
  moments.room_beside();
  const float* const latents = forward_to_decoder(network_, graph(), arena_, stream, moments.graph_ready);
  const FcnWeights& last = network_.fcn("decoder");
  decode({.rows = inputs_.particles,
          .frames = static_cast<int>(network_.config().bundle),
          .x = latents,
          .w1 = network_.tile("decoder", 0),
          .b1 = last.b1,
          .w2 = last.w2,
          .b2 = last.b2,
          .out = output_.data()},
         stream);
}

}  // namespace graupel::graph
