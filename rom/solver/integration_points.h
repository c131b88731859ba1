// Integration particles (NSF section 5.4): those whose weights reach a node that a sample reads. They are found again
// while the body moves: a margin of a cell around the samples' stencils stays valid until particles can have crossed
// it.
#pragma once

#include <memory>
#include <vector>

#include "rom/fields/fields.h"
#include "rom/solver/particle_grid.h"

namespace graupel::rom {

template <typename T>
class IntegrationPoints {
 public:
  /// `all`: every integration point there is. `samples` are particles of the scene, no two the same; they may be
  /// integration points themselves.
  IntegrationPoints(const Fields& fields, const GridParticles& all, const std::vector<int32_t>& samples,
                    const mpm::GridGeometry<T, 3>& grid);

  /// The samples, then the other integration points, neighbours after each other.
  const GridParticles& candidates() const { return all_; }
  /// Tiles of 16 candidates that hold samples, or points within reach of them at this state; ascending.
  std::vector<int32_t> find(const LatentState& state);
  /// Tells of a step in which no particle moved further than `distance` [m]; whether find() is due.
  bool stale_after(double distance);
  /// Margin around the samples' stencils [cells].
  static constexpr int margin = 1;
  int64_t bytes() const { return positions_->bytes() + static_cast<int64_t>(stamp_.size() * sizeof(uint32_t)); }

 private:
  GridParticles all_;
  std::unique_ptr<PointPositions<T>> positions_;  ///< of all candidates
  mpm::GridGeometry<T, 3> grid_;
  std::vector<T> position_;
  Vec<int, 3> cells_;
  std::vector<uint32_t> stamp_;  ///< [cells] round in which a base cell was last within reach
  uint32_t round_ = 0;
  double moved_ = 0;  ///< [m] since find()
  bool all_taken_ = false;
};

extern template class IntegrationPoints<float>;
extern template class IntegrationPoints<double>;

}  // namespace graupel::rom
