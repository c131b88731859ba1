// Contact of a grid velocity with a rigid surface at rest: stick, slip or separate, with Coulomb friction.
// The normal velocity that contact removes is the impulse per mass; friction takes at most mu times it from the
// tangential velocity (Stomakhin et al. 2013, section 8).
#pragma once

#include "core/scene/scene.h"

namespace graupel::mpm {

/// Velocity after contact. `normal` points out of the surface and has length 1.
template <typename T, int D>
GRAUPEL_HD inline Vec<T, D> apply_contact(Contact contact, T friction, const Vec<T, D>& normal, const Vec<T, D>& v) {
  if (contact == Contact::stick) return Vec<T, D>::zero();
  const T v_n = dot(normal, v);
  if (contact == Contact::separate && v_n >= T(0)) return v;
  const Vec<T, D> tangential = v - v_n * normal;
  if (v_n >= T(0) || friction == T(0)) return tangential;
  const T speed = norm(tangential), loss = -v_n * friction;
  return speed > loss ? tangential * (T(1) - loss / speed) : Vec<T, D>::zero();
}

}  // namespace graupel::mpm
