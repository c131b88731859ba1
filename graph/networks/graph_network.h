// Inference of a graph network on the CPU, without libtorch: the hierarchical graph network (HGN paper, figure 2) or
// the graph network simulator (GNS, Sanchez-Gonzalez et al. 2020). Its weights are those of its plan
// (LayerPlan::tensors; docs/reference/networks.md gives them as formulas), beside normalization.*
// (graph/features/normalization.h) and the metadata of its config. Weight names (shapes [out, in]); every FCN has
// layer1.{weight,bias} to layer<n + 1>.{weight,bias} for n hidden layers (HGN: one) and, but for the decoder,
// norm.{weight,bias}. H latent width, E embedding width, M iterations, L levels:
//   embedding.weight      [9, E]
//   encoder, encoder.node [features, embedding] -> H (HGN, GNS)
//   decoder               H -> H -> 3 k, no norm; k frames at once (FeatureConfig::bundle)
// HGN, R spacing:
//   particle_to_grid      [f_p, (centre - x)/R (3)] -> H
//   down.<l>.<k>.edge     l = 0..L-1, k = 0..M-1: [f_sender, f_receiver, e] -> H; e = (x_receiver - x_sender)/spacing
//                         (3) for k = 0, the edge latent (H) after
//   down.<l>.<k>.cell     [sum of messages, f] -> H
//   up.<l>.<k>.edge/.cell l = L-2..0, the same
//   restrict.<l>          fine l -> coarse l+1: [f_fine, (centre_coarse - centre_fine)/spacing_fine (3)] -> H
//   prolong.<l>           coarse l+1 -> fine l: [f_coarse, f_fine, (centre_fine - centre_coarse)/spacing_fine (3)] -> H
//   grid_to_particle      [f_cell, f_p, (x - centre)/R (3)] -> H
// HGN that sums activations (docs/decisions/0011-sums-of-activations.md) has, in front of each sum, a linear layer
// <name>.gather.{weight,bias} over the inputs above, and FCNs over the sums, once a receiver:
//   particle_to_grid, restrict.<l>   .gather, then sum -> H
//   <down|up>.<l>.<k>     .gather on [f_sender, f_receiver, (x_receiver - x_sender)/spacing (3)] in every iteration (no
//                         .edge), then .cell on [sum, f] -> H
//   grid_to_particle      .gather, then [sum, f_p] -> H
// GNS, R radius:
//   encoder.edge          [(x_sender - x_receiver)/R (3), |x_sender - x_receiver|/R] -> H
//   step.<k>.edge         k = 0..M-1: [f_sender, f_receiver, e] -> H
//   step.<k>.node         [sum of messages, f] -> H
// FCN(x) = LayerNorm(W_{n+1} a(.. a(W1 x + b1)) + b_{n+1}), eps 1e-5, a = LeakyReLU of slope 0.01, of GNS leaky_slope.
#pragma once

#include <memory>
#include <vector>

#include "graph/config/network_config.h"
#include "graph/network.h"

namespace graupel::graph {

class GraphNetwork : public Network {
 public:
  /// Throws InputError when the file is of another architecture, or a tensor is missing or of another shape.
  explicit GraphNetwork(const nn::Weights& weights);
  ~GraphNetwork() override;

  const NetworkConfig& config() const;
  const FeatureConfig& feature_config() const override;
  const Normalization& normalization() const override;
  double spacing() const override;

  /// Normalised accelerations [n, 3 k] from features [n, input_width - embedding], types and positions [n] of all
  /// particles, those of obstacles included. `origin` is that of HGN's grid.
  std::vector<float> forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position, const Vec3d& origin = {}) const;

  /// The grid's origin is the domain's lower corner. The obstacle particles, where the network was trained with them,
  /// come from the environment.
  std::vector<float> predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                             const std::vector<std::vector<Vec3f>>& positions, FrameTiming& timing) const override;
  double flop(const Environment& environment, const std::vector<Vec3f>& position) const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Adds the obstacle particles within reach of the newest positions to particles: resting at every time, of type
/// obstacle_particle_type, behind the others. Nothing where the network has none.
void add_obstacle_particles(const GnsConfig& config, const Environment& environment,
                            std::vector<std::vector<Vec3f>>& positions, std::vector<int32_t>& particle_type);

}  // namespace graupel::graph
