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
  for (int l = 0; l < inputs_.room.levels; ++l) placed.level.push_back(places_.level(l));
  return placed;
}

void MessageNetwork::follow_grid(void* grid_stream) { places_.place(inputs_.grid, inputs_.particles, grid_stream); }

void MessageNetwork::launch(void* stream, const LaunchHooks& moments) {
  moments.room_beside();
  const float* const latents = forward_to_decoder(network_, graph(), arena_, stream, moments.graph_ready);
  const DeviceFcn& last = network_.fcn("decoder");
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
