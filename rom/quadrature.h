// Integration points: the particles of the body, or clusters of neighbours. Fields whose modes are averaged over a
// cluster give the cluster's mean position, velocity, stress and affine velocity, so that a cluster carries the mass,
// momentum and mean stress of its members; picking single particles instead would keep the noise of their stress.
#pragma once

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace graupel::rom {

/// Which cluster every particle belongs to.
struct Clusters {
  int64_t count = 0;
  std::vector<int32_t> of_particle;  ///< [particles], 0 to count - 1
  /// First particle of every cluster, [count].
  std::vector<int32_t> first_members() const;
};

/// Clusters of about `size` particles that lie together in the reference body; the particles of a cluster have one
/// `kind` (material, script). With size 1 every particle is its own.
Clusters make_clusters(const std::vector<Vec3f>& reference, const std::vector<int32_t>& kind, int size);

}  // namespace graupel::rom
