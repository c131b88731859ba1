// Gravity that changes during a run.
#pragma once

#include <algorithm>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/fields.h"
#include "core/scene/keyframes.h"

namespace graupel {

/// Of each component [m/s^2].
inline constexpr Range gravity_range = Range::between(-1e6, 1e6);

struct GravityKey {
  double time = 0;            ///< [s]
  Vec3d gravity = {0, 0, 0};  ///< [m/s^2]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using K = GravityKey;
    visit(&K::time,
          FieldInfo{"time", "s", "Time of the value, above that of the key before it", Range::positive()}.mandatory());
    visit(&K::gravity, FieldInfo{"gravity", "m/s^2", "Gravity then", gravity_range}.mandatory());
  }
};

/// Gravity at a time [m/s^2]; `initial` is that at time 0.
inline Vec3d gravity_at(const Vec3d& initial, const std::vector<GravityKey>& keys, double time) {
  const auto [before, after, fraction] = keys_around(GravityKey{0, initial}, keys, time);
  return before.gravity + fraction * (after.gravity - before.gravity);
}

/// Mean of gravity over [from, from + dt], exact: a step with it gives the impulse of the path. Without keys the
/// initial value, to the bit.
inline Vec3d mean_gravity(const Vec3d& initial, const std::vector<GravityKey>& keys, double from, double dt) {
  if (keys.empty()) return initial;
  Vec3d mean = {0, 0, 0};
  double begin = from;
  const auto add_until = [&](double end) {
    const Vec3d g = 0.5 * (gravity_at(initial, keys, begin) + gravity_at(initial, keys, end));
    mean += ((end - begin) / dt) * g;
    begin = end;
  };
  for (const GravityKey& key : keys)
    if (key.time > from && key.time < from + dt) add_until(key.time);
  if (begin == from) return 0.5 * (gravity_at(initial, keys, from) + gravity_at(initial, keys, from + dt));
  add_until(from + dt);
  return mean;
}

/// Largest magnitude at any time [m/s^2]: it is that of a key.
inline double largest_gravity(const Vec3d& initial, const std::vector<GravityKey>& keys) {
  double largest = norm(initial);
  for (const GravityKey& key : keys) largest = std::max(largest, norm(key.gravity));
  return largest;
}

}  // namespace graupel
