// Inference of the hierarchical graph network on the CPU (HGN paper, figure 2), without libtorch.
//
// Weight names (shapes [out, in]); every FCN has layer1.{weight,bias}, layer2.{weight,bias} and, but for the decoder,
// norm.{weight,bias}. L levels, M iterations, H latent width, E embedding width, R spacing:
//   embedding.weight      [9, E]
//   encoder               [features, embedding] -> H
//   particle_to_grid      [f_p, (centre - x)/R (3)] -> H
//   down.<l>.<k>.edge     l = 0..L-1, k = 0..M-1: [f_sender, f_receiver, e] -> H; e = (x_receiver - x_sender)/spacing
//   (3)
//                         for k = 0, the edge latent (H) after
//   down.<l>.<k>.cell     [sum of messages, f] -> H
//   up.<l>.<k>.edge/.cell l = L-2..0, the same
//   restrict.<l>          fine l -> coarse l+1: [f_fine, (centre_coarse - centre_fine)/spacing_fine (3)] -> H
//   prolong.<l>           coarse l+1 -> fine l: [f_coarse, f_fine, (centre_fine - centre_coarse)/spacing_fine (3)] -> H
//   grid_to_particle      [f_cell, f_p, (x - centre)/R (3)] -> H
//   decoder               H -> H -> 3 k, no norm; k frames at once (FeatureConfig::bundle)
// A network that sums activations (docs/decisions/0011-sums-of-activations.md) has, in front of each sum, a linear
// layer <name>.gather.{weight,bias} over the inputs above, and FCNs over the sums, once a receiver:
//   particle_to_grid      .gather, then sum -> H
//   <down|up>.<l>.<k>     .gather on [f_sender, f_receiver, (x_receiver - x_sender)/spacing (3)] in every iteration (no
//                         .edge), then .cell on [sum, f] -> H
//   restrict.<l>          .gather, then sum -> H
//   grid_to_particle      .gather, then [sum, f_p] -> H
// Beside them: normalization.* (graph/features/normalization.h) and the metadata of HgnConfig.
// FCN(x) = LayerNorm(W2 LeakyReLU_0.01(W1 x + b1) + b2), eps 1e-5.
#pragma once

#include <memory>
#include <vector>

#include "graph/config/hgn_config.h"
#include "graph/network.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

class HierarchicalGraphNetwork : public Network {
 public:
  /// Throws InputError when the file is of another architecture, or a tensor is missing or of another shape.
  explicit HierarchicalGraphNetwork(const nn::Weights& weights);
  ~HierarchicalGraphNetwork() override;
  HierarchicalGraphNetwork(HierarchicalGraphNetwork&&) noexcept;

  const HgnConfig& config() const;
  const FeatureConfig& feature_config() const override;
  const Normalization& normalization() const override;
  double spacing() const override;

  /// Normalised accelerations [n, 3 k] from features [n, input_width - embedding] and particle types [n].
  std::vector<float> forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const sparsegrid::Hierarchy<3>& hierarchy) const;

  /// The grid's origin is the domain's lower corner.
  std::vector<float> predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                             const std::vector<std::vector<Vec3f>>& positions, FrameTiming& timing) const override;
  double flop(const Environment& environment, const std::vector<Vec3f>& position) const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::graph
