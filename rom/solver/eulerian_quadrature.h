// Quadrature points of the cells that share nodes with the samples (CROM algorithm 4): each is traced back to its
// material point X by Newton's method on g(X, q) = x, which gives F, velocity and mass rho_0 V / det F there. No other
// particle is tracked, so the work does not depend on how many there are.
#pragma once

#include <memory>
#include <vector>

#include "core/math/mat.h"
#include "mpm/phases/phases.h"
#include "mpm/sampling.h"
#include "rom/deformation/deformation.h"
#include "rom/solver/quadrature.h"
#include "rom/solver/reference_body.h"

namespace graupel::rom {

template <typename T>
class EulerianQuadrature final : public Quadrature<T> {
 public:
  /// `reference` X of all particles [n, 3] [m]; `per_axis` points a cell along each axis (the paper's l). The map must
  /// outlive this.
  EulerianQuadrature(const Deformation& map, const std::vector<float>& reference,
                     const mpm::SampledParticles& particles, const std::vector<int32_t>& samples,
                     const mpm::GridGeometry<T, 3>& geometry, int per_axis, ParticleGrid<T>& grid);

  void find(const LatentState& state, ParticleGrid<T>& grid) override;
  void fill(const LatentState& state, ParticleGrid<T>& grid) override;
  void moved(double) override {}
  int64_t bytes() const override;

 private:
  void propose();
  void trace_back(const LatentState& state);

  ReferenceBody body_;
  std::vector<int32_t> material_;  ///< of all particles
  mpm::GridGeometry<T, 3> geometry_;
  int per_axis_;
  std::unique_ptr<DeformationPoints<T>> samples_, points_;
  int64_t sample_count_;
  std::vector<float> sample_reference_;
  std::vector<T> sample_position_, sample_velocity_, sample_gradient_;  ///< in tiles
  Vec<int, 3> cells_;
  std::vector<uint32_t> stamp_;  ///< [cells] round in which a cell was last near a sample
  uint32_t round_ = 0;
  /// A point on its way back: its place x [m] and the material point X so far.
  struct Guess {
    Vec3d place, material_point;
  };
  /// A point that was traced back into the body.
  struct Point {
    Vec3d position, velocity;
    Mat<double, 3> gradient;
    int32_t particle;  ///< nearest to X
  };
  std::vector<Guess> guesses_;
  std::vector<Point> found_;
  std::vector<float> material_points_;             ///< of guesses_, as the map takes them
  std::vector<T> position_, velocity_, gradient_;  ///< of these, in tiles
};

extern template class EulerianQuadrature<float>;
extern template class EulerianQuadrature<double>;

}  // namespace graupel::rom
