// Contact of a grid velocity with a rigid surface at rest: stick, slip or separate, with Coulomb friction.
// The normal velocity that contact removes is the impulse per mass; friction takes at most mu times it from the
// tangential velocity (Stomakhin et al. 2013, section 8). Without branches, since lanes of a GPU meet several laws.
#pragma once

#include "core/scene/scene.h"

namespace graupel::mpm {

/// loss / |v|: by a root and a quotient, or to a few units in the last place where a GPU needs it often.
struct ExactFraction {
  template <typename T, int D>
  GRAUPEL_HD static T of(T loss, const Vec<T, D>& v) {
    return loss / norm(v);
  }
};
struct FastFraction {
  template <int D>
  GRAUPEL_HD static float of(float loss, const Vec<float, D>& v) {
    return loss * fast_inverse_root(norm2(v));
  }
};

/// Velocity after contact. `normal` points out of the surface and has length 1.
template <typename Fraction = ExactFraction, typename T, int D>
GRAUPEL_HD inline Vec<T, D> apply_contact(Contact contact, T friction, const Vec<T, D>& normal, const Vec<T, D>& v) {
  const T v_n = dot(normal, v);
  const Vec<T, D> tangential = v - v_n * normal;
  const bool slides = v_n >= T(0) || friction == T(0);
  const T left = slides ? T(1) : T(1) - Fraction::of(-v_n * friction, tangential);
  if (contact == Contact::separate && v_n >= T(0)) return v;
  return contact != Contact::stick && left > T(0) ? left * tangential : Vec<T, D>::zero();
}

}  // namespace graupel::mpm
