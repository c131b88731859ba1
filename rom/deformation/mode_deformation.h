// A deformation map by modes, the linear subspace of reduced elasticity (Barbic and James 2005):
//   g(X, q) = X + sum_k (q_k - q0_k) u_k(X),   dg/dX = I + sum_k (q_k - q0_k) du_k/dX,
// which is exactly X in the rest state q0. A mode u_k is a B-spline of nodes (rom/deformation/mode_lattice.h).
#pragma once

#include <vector>

#include "nn/weights.h"
#include "rom/deformation/deformation.h"
#include "rom/deformation/mode_lattice.h"

namespace graupel::rom {

class ModeDeformation final : public Deformation {
 public:
  /// `nodes` u_k [modes, nodes, 3] [m]; `rest` q0 [modes].
  ModeDeformation(ModeLattice lattice, std::vector<float> nodes, std::vector<double> rest);

  DeformationKind kind() const override { return DeformationKind::modes; }
  int latents() const override { return static_cast<int>(rest_.size()); }
  std::unique_ptr<DeformationPoints<float>> bind_f32(const std::vector<float>& points,
                                                     PointTables tables) const override;
  std::unique_ptr<DeformationPoints<double>> bind_f64(const std::vector<float>& points,
                                                      PointTables tables) const override;
  std::unique_ptr<SampleField> bind_samples(const std::vector<float>& points) const override;
  void store(nn::Weights& weights) const override;
  /// Throws InputError unless the file has the modes of so many latents on a lattice that fits them.
  static ModeDeformation load(const nn::Weights& weights, std::vector<double> rest);
  static bool is_in(const nn::Weights& weights);

  const ModeLattice& lattice() const { return lattice_; }
  const std::vector<float>& nodes() const { return nodes_; }
  const std::vector<double>& rest() const { return rest_; }
  /// u_k [m] and du_k/dX where the stencil is.
  Vec3d mode(const ModeStencil& stencil, int k) const;
  Mat3d mode_slope(const ModeStencil& stencil, int k) const;
  /// Factors of the modes: q - q0, and their rates [1/s], those of the state or over its last step.
  std::vector<double> away_from_rest(const LatentState& state) const;
  static std::vector<double> rate_of(const LatentState& state);

 private:
  ModeLattice lattice_;
  std::vector<float> nodes_;
  std::vector<double> rest_;
};

}  // namespace graupel::rom
