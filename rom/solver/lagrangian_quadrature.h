// Particles or clusters of them near the samples as quadrature points, with the fields bound to them.
#pragma once

#include <memory>
#include <numeric>
#include <vector>

#include "rom/solver/integration_points.h"
#include "rom/solver/quadrature.h"

namespace graupel::rom {

template <typename T>
class LagrangianQuadrature final : public Quadrature<T> {
 public:
  /// As IntegrationPoints; the grid then has these points, all of them in every step where their gradients are
  /// integrated.
  LagrangianQuadrature(const Fields& fields, const GridParticles& all, const std::vector<int32_t>& samples,
                       const mpm::GridGeometry<T, 3>& geometry, GradientKind gradient, ParticleGrid<T>& grid)
      : gradient_(gradient),
        points_(fields, all, samples, geometry),
        fields_(bind_fields<T>(fields, points_.candidates().particles)) {
    grid.choose(points_.candidates());
  }

  void find(const LatentState& state, ParticleGrid<T>& grid) override {
    if (!due_) return;
    due_ = false;
    std::vector<int32_t> found = gradient_ == GradientKind::integrated ? all_tiles() : points_.find(state);
    if (found == tiles_) return;
    tiles_ = std::move(found);
    grid.select(tiles_);
  }
  void fill(const LatentState& state, ParticleGrid<T>& grid) override {
    mpm::ParticleView<T> particles = grid.particles();
    if (gradient_ == GradientKind::integrated) {  // these stay as the step left them
      particles.deformation_gradient.data = nullptr;
      particles.stress.data = particles.affine_velocity.data = nullptr;
    }
    fields_->decode(state, tiles_, particles);
  }
  void moved(double distance) override { due_ = points_.stale_after(distance); }
  int64_t bytes() const override { return points_.bytes() + fields_->bytes(); }

 private:
  std::vector<int32_t> all_tiles() const {
    const auto points = static_cast<int64_t>(points_.candidates().particles.size());
    std::vector<int32_t> tiles(static_cast<std::size_t>(mpm::padded_to_tile(points) / mpm::tile));
    std::iota(tiles.begin(), tiles.end(), 0);
    return tiles;
  }

  GradientKind gradient_;
  IntegrationPoints<T> points_;
  std::unique_ptr<PointFields<T>> fields_;
  std::vector<int32_t> tiles_;  ///< of the candidates, that take part
  bool due_ = true;             ///< they are to be found again
};

}  // namespace graupel::rom
