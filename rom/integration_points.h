// Integration particles (NSF section 5.4): those whose weights reach a node that a sample reads. They are found again
// while the body moves: a margin of a cell around the samples' stencils stays valid until particles can have crossed
// it.
#pragma once

#include <memory>
#include <vector>

#include "rom/fields.h"
#include "rom/particle_grid.h"

namespace graupel::rom {

template <typename T>
class IntegrationPoints {
 public:
  /// `all`: every integration point there is. `samples` are particles of the scene, no two the same; they may be
  /// integration points themselves.
  IntegrationPoints(const Fields& fields, GridParticles all, std::vector<int32_t> samples,
                    const mpm::GridGeometry<T, 3>& grid);

  /// The samples, then the other integration points within reach of them at this state.
  GridParticles find(const LatentState& state);
  /// Tells of a step in which no particle moved further than `distance` [m]; whether find() is due.
  bool stale_after(double distance);
  /// Margin around the samples' stencils [cells].
  static constexpr int margin = 1;
  int64_t bytes() const { return candidates_->bytes() + static_cast<int64_t>(stamp_.size() * sizeof(uint32_t)); }

 private:
  std::vector<int32_t> samples_;
  std::vector<double> sample_share_;               ///< of the body; 0 for a sample that is no integration point
  GridParticles all_;                              ///< the other integration points
  std::unique_ptr<PointPositions<T>> candidates_;  ///< the samples, then all integration points
  mpm::GridGeometry<T, 3> grid_;
  std::vector<T> position_;
  Vec<int, 3> cells_;
  std::vector<uint32_t> stamp_;  ///< [cells] round in which a base cell was last within reach
  uint32_t round_ = 0;
  double moved_ = 0;  ///< [m] since find()
};

extern template class IntegrationPoints<float>;
extern template class IntegrationPoints<double>;

}  // namespace graupel::rom
