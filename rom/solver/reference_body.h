// The reference body as its particles sample it: which particle is nearest to a point, and whether the point is inside.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::rom {

/// A lattice of half the particles' spacing, every point of which knows its nearest particle. Inside is what lies
/// within one distance of a particle, chosen so that the inside's volume is the particles'.
class ReferenceBody {
 public:
  /// `reference` X [n, 3] [m] and the particles' volumes [n] [m^3].
  ReferenceBody(const std::vector<float>& reference, const std::vector<double>& volume);

  /// The nearest particle of the point's place in the lattice, -1 where the point is outside of the body.
  int32_t particle_at(const Vec3d& point) const;
  /// Whether the point is inside, or outside by at most about one spacing.
  bool near(const Vec3d& point) const;
  int64_t bytes() const { return static_cast<int64_t>(nearest_.size() * sizeof(int32_t) + inside_.size() / 8); }

 private:
  /// In the lattice; -1 outside of it.
  int64_t place_of(const Vec3d& point) const;

  Vec3d low_;
  double width_ = 0;
  Vec<int, 3> count_;
  std::vector<int32_t> nearest_;  ///< [x, y, z]; -1 where none is within 1.5 spacings
  std::vector<bool> inside_;      ///< [x, y, z]
};

}  // namespace graupel::rom
