#include "graph/cuda/forward/message_network.h"

#include "core/system/error.h"

namespace graupel::graph {

MessageNetwork::MessageNetwork(const HgnConfig& config, const nn::Weights& weights)
    : weights_(weights), network_(plan_of(config), std::cref(weights_)) {
  network_.refresh(nullptr);
}

void MessageNetwork::prepare(const GridInputs& inputs) {
  GRAUPEL_ASSERT(inputs.particles_of_scene.size() == 1);
  inputs_ = inputs;
  places_.prepare(inputs.capacity);
  output_.resize_discard(static_cast<std::size_t>(network_.plan().layers.back().outputs * inputs.particles));
}

NetworkGraph MessageNetwork::graph() const {
  const GridLinks& links = inputs_.grid;
  NetworkGraph placed;
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
  for (int l = 0; l < inputs_.capacity.levels; ++l) placed.level.push_back(places_.level(l));
  return placed;
}

void MessageNetwork::follow_grid(void* grid_stream) { places_.place(inputs_.grid, inputs_.particles, grid_stream); }

void MessageNetwork::launch(void* stream, const LaunchHooks& moments) {
  moments.room_beside();
  Decoder decoder = network_.decoder();
  decoder.rows = inputs_.particles;
  decoder.x = forward_messages(network_, graph(), arena_, nullptr, record_, stream, moments.graph_ready);
  decoder.out = output_.data();
  decode(decoder, stream);
}

}  // namespace graupel::graph
