// What carries the body's mass, motion and stress to the grid in a step: a strategy of the reduced solver.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "rom/projection/latent_state.h"
#include "rom/solver/particle_grid.h"

namespace graupel::rom {

enum class QuadratureKind {
  lagrangian,  ///< particles or clusters of them, near the samples (NSF section 5.4, CROM algorithm 3)
  eulerian     ///< points of the cells near the samples, by the inverse of the deformation map (CROM algorithm 4)
};

constexpr auto enum_list(QuadratureKind) {
  return std::to_array<std::pair<const char*, QuadratureKind>>(
      {{"lagrangian", QuadratureKind::lagrangian}, {"eulerian", QuadratureKind::eulerian}});
}

template <typename T>
class Quadrature {
 public:
  virtual ~Quadrature() = default;
  /// Finds the points of this state.
  virtual void find(const LatentState& state, ParticleGrid<T>& grid) = 0;
  /// Writes samples and points into the grid's particles, the samples into its first slots; stress is to follow where
  /// the fields have F instead.
  virtual void fill(const LatentState& state, ParticleGrid<T>& grid) = 0;
  /// Tells of a step in which no sample moved further than `distance` [m].
  virtual void moved(double distance) = 0;
  virtual int64_t bytes() const = 0;
};

}  // namespace graupel::rom
