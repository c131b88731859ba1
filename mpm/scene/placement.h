// Random numbers of a scene's layout, and bodies that are placed without overlaps.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/math/random.h"
#include "core/scene/interval.h"
#include "core/scene/scene.h"

namespace graupel::mpm {

/// Numbers in the order they are asked for.
class Draws {
 public:
  Draws(uint64_t seed, uint64_t stream) : random_(seed, RandomPurpose::scene_layout, stream) {}
  double uniform(double low, double high) { return random_.uniform(next_++, 0, low, high); }
  /// In [0, n).
  uint32_t integer(uint32_t n) { return random_.integer(next_++, 0, n); }
  int64_t whole(const WholeInterval& range) {
    return range.low + integer(static_cast<uint32_t>(range.high - range.low + 1));
  }
  bool chance(double share) { return uniform(0, 1) < share; }
  template <typename List>
  const auto& one_of(const List& list) {
    return list[integer(static_cast<uint32_t>(list.size()))];
  }
  /// Uniform in the interval; in its logarithm where that spans a factor of ten or more.
  double in(const Interval& range) {
    if (!spans_magnitudes(range)) return uniform(range.low, range.high);
    return std::clamp(std::exp(uniform(std::log(range.low), std::log(range.high))), range.low, range.high);
  }
  static bool spans_magnitudes(const Interval& range) {
    return range.low > 0 && range.high >= 10 * (1 - 1e-9) * range.low;
  }
  Vec3d point(const Vec3d& low, const Vec3d& high);
  /// Uniform on the unit sphere.
  Vec3d direction();
  /// Uniform rotation (Shoemake 1992) as axis and angle [degrees].
  void rotation(Vec3d& axis, double& angle);

 private:
  Random random_;
  uint64_t next_ = 0;
};

/// A body whose largest extent along its axes is `size` [m].
void set_size(Body& body, double size);

/// No point of the body is farther from its position than this [m].
double reach(const Body& body);

/// Whether points on and in one body's bounding box, at a small share of its size from each other, lie in both bodies.
bool overlap(const Body& a, const Body& b);

/// Whether the bodies may be nearer to each other than `gap` [m]. Never false where they are: distances change by no
/// more than the way between two points, so that points at a spacing h decide for all within sqrt(3)/2 h.
bool may_touch(const Body& a, const Body& b, double gap);

/// Draws bodies until one fits, 200 at most, and no more than `left`, which it counts down.
template <typename Draw, typename Fits>
bool place(Draw&& draw, Fits&& fits, int64_t& left) {
  for (int attempt = 0; attempt < 200 && left > 0; ++attempt, --left)
    if (fits(draw())) return true;
  return false;
}
template <typename Draw, typename Fits>
bool place(Draw&& draw, Fits&& fits) {
  int64_t any = std::numeric_limits<int64_t>::max();
  return place(draw, fits, any);
}

}  // namespace graupel::mpm
