// Density on a grid: mass of each material that is in the run spread trilinearly (bilinearly in the plane) to nodes of
// spacing 2 dx, and errors of it. Along a periodic axis nodes are the nearest spacing apart that divides the period.
//   relative L1 = sum_{node, material} |m - m*| / sum m*       occupancy IoU = |O and O*| / |O or O*|,
// O: nodes where material (any, or one) takes more than a tenth of the volume.
#pragma once

#include <cstdint>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "compare/metrics/space.h"
#include "core/scene/scene.h"

namespace graupel::compare {

class DensityGrid {
 public:
  /// Nodes from the lower to the upper corner of the domain, along periodic axes from the lower wall on.
  explicit DensityGrid(const Domain& domain);

  /// Mass [kg] and share of the volume per type and node. Particles outside the domain count at its surface.
  struct Field {
    std::vector<std::vector<double>> mass;  ///< [type][node]
    std::vector<double> fill;               ///< [node] volume of material at rest / volume of the node's cell
    std::vector<std::vector<double>> material_fill = {};  ///< [type][node] the same of each type
  };
  Field spread(const ParticleRun& run, std::size_t frame, const std::vector<int32_t>& types) const;

  static double relative_l1(
      const Field& truth, const Field& other);  ///< 0 same, 2 nothing in common (equal masses), or a truth without mass
  static double occupancy_iou(const Field& truth, const Field& other);  ///< 1 same; 1 when both are empty
  /// Of one type's nodes alone; `type` counts in the list given to spread.
  static double occupancy_iou(const Field& truth, const Field& other, std::size_t type);

  int64_t nodes() const { return static_cast<int64_t>(count_[0]) * count_[1] * count_[2]; }

 private:
  Space space_;
  Vec3d origin_, spacing_;
  Vec3i count_ = {1, 1, 1};
};

inline constexpr double occupied_fill = 0.1;

}  // namespace graupel::compare
