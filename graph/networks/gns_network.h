// Inference of the graph network simulator (GNS, Sanchez-Gonzalez et al. 2020) on the CPU, without libtorch.
//
// Weight names (shapes [out, in]); every FCN has layer1.{weight,bias} to layer<n + 1>.{weight,bias} for n hidden layers
// and, but for the decoder, norm.{weight,bias}. M steps, H latent width, E embedding width, R radius:
//   embedding.weight      [9, E]
//   encoder.node          [features, embedding] -> H
//   encoder.edge          [(x_sender - x_receiver)/R (3), |x_sender - x_receiver|/R] -> H
//   step.<k>.edge         k = 0..M-1: [f_sender, f_receiver, e] -> H
//   step.<k>.node         [sum of messages, f] -> H
//   decoder               H -> H -> 3 k, no norm; k frames at once (FeatureConfig::bundle)
// Beside them: normalization.* (graph/features/normalization.h) and the metadata of GnsConfig.
// FCN(x) = LayerNorm(W_{n+1} a(.. a(W1 x + b1)) + b_{n+1}), eps 1e-5, a = LeakyReLU of slope leaky_slope (0: ReLU).
#pragma once

#include <memory>
#include <vector>

#include "graph/config/gns_config.h"
#include "graph/network.h"

namespace graupel::graph {

class GnsNetwork : public Network {
 public:
  /// Throws InputError when the file is of another architecture, or a tensor is missing or of another shape.
  explicit GnsNetwork(const nn::Weights& weights);
  ~GnsNetwork() override;
  GnsNetwork(GnsNetwork&&) noexcept;

  const GnsConfig& config() const;
  const FeatureConfig& feature_config() const override;
  const Normalization& normalization() const override;
  double spacing() const override;

  /// Normalised accelerations [n, 3 k] from features [n, input_width - embedding], types and positions [n] of all
  /// particles, those of obstacles included.
  std::vector<float> forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position) const;

  /// The obstacle particles, where the network was trained with them, come from the environment.
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
