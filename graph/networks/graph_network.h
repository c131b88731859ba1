// Inference of a graph network on the CPU, without libtorch: the hierarchical graph network (HGN paper, figure 2) or
// the graph network simulator (GNS, Sanchez-Gonzalez et al. 2020). A weights file holds the tensors of its plan
// (LayerPlan::tensors; docs/reference/network_plans.md lists them, networks.md gives the formulas), normalization.*
// (graph/features/normalization.h), and the config as metadata.
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
                             const std::vector<int32_t>& material, const std::vector<std::vector<Vec3f>>& positions,
                             FrameTiming& timing, const NetworkEngine* engine = nullptr) const override;
  double flop(const Environment& environment, const std::vector<Vec3f>& position) const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Adds the obstacle particles within reach of the newest positions to particles: where they were at every time, of
/// type obstacle_particle_type, behind the others; they have no material. Nothing where the network has none.
void add_obstacle_particles(const GnsConfig& config, const Environment& environment,
                            std::vector<std::vector<Vec3f>>& positions, std::vector<int32_t>& particle_type);

}  // namespace graupel::graph
