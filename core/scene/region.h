// Parts of space that a scene speaks of: particles that a script moves, and sinks that remove particles.
#pragma once

#include <optional>

#include "core/math/mat.h"
#include "core/scene/fields.h"
#include "core/scene/motion.h"

namespace graupel {

enum class RegionShape {
  box,        ///< edges `size`, centred at `position`
  sphere,     ///< `radius` about `position`
  half_space  ///< the side of the plane through `position` that `normal` points away from
};
template <>
struct EnumWords<RegionShape> {
  static constexpr std::pair<const char*, RegionShape> words[] = {
      {"box", RegionShape::box}, {"sphere", RegionShape::sphere}, {"half_space", RegionShape::half_space}};
};

struct Region {
  RegionShape shape = RegionShape::box;
  Vec3d size = {0.1, 0.1, 0.1};  ///< [m]
  double radius = 0.05;          ///< [m]
  Vec3d normal = {0, 1, 0};      ///< any length but zero
  Vec3d position = {0, 0, 0};    ///< [m]

  GRAUPEL_HD bool contains(const Vec3d& x) const {
    const Vec3d r = x - position;
    if (shape == RegionShape::sphere) return norm2(r) <= radius * radius;
    if (shape == RegionShape::half_space) return dot(r, normal) <= 0;
    for (int d = 0; d < 3; ++d)
      if (!(std::abs(r[d]) <= 0.5 * size[d])) return false;
    return true;
  }

  template <typename Self, typename Visitor>
  static void region_fields(Visitor&& visit) {
    visit(&Self::shape, FieldInfo{"shape", "", "Kind of region"}.mandatory());
    visit(&Self::size, FieldInfo{"size", "m", "Edge lengths", Range::positive()}.mandatory().only_in("box"));
    visit(&Self::radius, FieldInfo{"radius", "m", "Radius", Range::positive()}.mandatory().only_in("sphere"));
    visit(&Self::normal, FieldInfo{"normal", "", "Direction out of the half-space"}.mandatory().only_in("half_space"));
    visit(&Self::position, FieldInfo{"position", "m", "Centre, or a point of the plane"});
  }
};

/// Removes every particle that enters it.
struct Sink : Region {
  template <typename Visitor>
  static void fields(Visitor&& visit) {
    Region::region_fields<Sink>(visit);
  }
};

/// The particles that are inside at the start follow a script.
struct KinematicRegion : Region {
  Motion motion;
  std::optional<double> release_time;  ///< [s]; then the particles are free

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using K = KinematicRegion;
    Region::region_fields<K>(visit);
    visit(&K::motion, FieldInfo{"motion", "", "Script that the particles inside at the start follow; {} holds them"});
    visit(&K::release_time,
          FieldInfo{"release_time", "s", "When they become free; default never", Range::not_negative()});
  }
};

}  // namespace graupel
