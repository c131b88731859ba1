// Integration points: the particles of the body, or one for each cluster of neighbours, which stands for the mass and
// volume of all with their mean stress and affine velocity. It keeps its own place: at the clusters' centres the body
// would end too early, at its surface and on the floor (docs/reference/reduced-order.md).
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::rom {

/// Which cluster every particle belongs to.
struct Clusters {
  int64_t count = 0;
  std::vector<int32_t> of_particle;  ///< [particles], 0 to count - 1
  std::vector<int32_t> points;       ///< the particle of each that is its integration point; empty: a random one
  /// Integration point of every cluster, [count]; -1 for a cluster without particles.
  std::vector<int32_t> representatives() const;
};

/// Clusters of about `size` particles that lie together in the reference body; the particles of a cluster have one
/// `kind` (material, script). With size 1 every particle is its own.
Clusters make_clusters(const std::vector<Vec3f>& reference, const std::vector<int32_t>& kind, int size);

}  // namespace graupel::rom
