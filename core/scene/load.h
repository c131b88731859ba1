// Loads: forces on the matter in a ball, for a time. What can move in the ball when a load starts carries it until its
// end, wherever it goes, in proportion to mass: all carriers have the acceleration force / (mass of the carriers).
#pragma once

#include <algorithm>

#include "core/math/vec.h"
#include "core/scene/fields.h"

namespace graupel {

struct Load {
  Vec3d place = {0, 0, 0};  ///< centre of the ball [m]
  double radius = 0;        ///< [m]
  Vec3d force = {0, 0, 0};  ///< on all carriers together [N]
  double duration = 0;      ///< [s]
};

/// A load that starts at a time of the run.
struct TimedLoad : Load {
  double start = 0;  ///< [s]

  double end() const { return start + duration; }
  /// Seconds of [from, from + dt] in which it acts. A start within rounding of the interval's end belongs to the next
  /// one, whose matter then carries it.
  double acts(double from, double dt) const {
    constexpr double rounding = 1e-9;  // of dt
    const double to = from + dt;
    return start > to - rounding * dt ? 0 : std::max(0.0, std::min(end(), to) - std::max(start, from));
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using L = TimedLoad;
    visit(&L::start, FieldInfo{"start", "s", "When it starts, within the run", Range::not_negative()});
    visit(&L::duration, FieldInfo{"duration", "s", "How long it acts", Range::positive()}.mandatory());
    visit(&L::place,
          FieldInfo{"place", "m", "Centre of the ball; what is in it at the start carries the load"}.mandatory());
    visit(&L::radius, FieldInfo{"radius", "m", "Radius of the ball", Range::positive()}.mandatory());
    visit(&L::force, FieldInfo{"force", "N", "On all that carries it together, in proportion to mass"}.mandatory());
  }
};

}  // namespace graupel
