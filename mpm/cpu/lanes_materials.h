// One step of a material, a particle in every lane: the laws of mpm/materials/ over Pack<T>, and what the lanes do to
// find the singular values that some of them are functions of. No right rotation is needed: with
// b = F F^T = U diag(s^2) U^T, a return map of the singular values s -> s' is F <- U diag(s'/s) U^T F. Equals
// mpm/materials/material.h; its gain is in that of the whole pass (docs/decisions/0006-cpu-tuning.md).
#pragma once

#include "mpm/cpu/pack.h"
#include "mpm/materials/list.h"

namespace graupel::mpm {
namespace {

/// What a step reads and changes. `special` lanes (inverted or squeezed to a quarter) are not for these functions.
template <typename T>
struct LaneState {
  LaneMatrix<T> F;
  Lanes<T> internal;
  LaneSymmetric<T> tau;
  Lanes<T> sound_speed;  ///< of the new state [m/s]
  Mask<T> special;
};

template <typename T>
GRAUPEL_LANES LaneMatrix<T> increment_of(const LaneMatrix<T>& C, T dt) {
  LaneMatrix<T> A;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) A.m[r][c] = dt * C.m[r][c] + (r == c ? T(1) : T(0));
  return A;
}

/// b = F F^T -> eigenvalues and vectors, and whether they are all far from 0.
template <typename T>
GRAUPEL_LANES LaneMatrix<T> decompose(LaneState<T>& s, Lanes<T> (&stretch2)[3]) {
  LaneSymmetric<T> b = left_stretch2(s.F);
  const LaneMatrix<T> U = eigenvectors(b);
  for (int k = 0; k < 3; ++k) stretch2[k] = b.s[k];
  const Lanes<T> low = smaller(b.s[0], smaller(b.s[1], b.s[2])), high = larger(b.s[0], larger(b.s[1], b.s[2]));
  // Also lanes with NaN.
  s.special = ~((low > T(0.0625) * high) & (high < T(1e6)) & (low > T(1e-6)) & (determinant_of(s.F) > T(0)));
  return U;
}

/// Return mapping and stress of a law of singular values or their logarithms.
template <typename Law, typename T>
GRAUPEL_LANES void map_principal(const MaterialParameters<T>& m, T dt, LaneState<T>& s, Pack<T>& internal) {
  constexpr bool logarithms = Law::measure == Measure::logarithms;
  Lanes<T> stretch2[3], ratio[3];
  const LaneMatrix<T> U = decompose(s, stretch2);
  Vec<Pack<T>, 3> trial, mapped, principal;
  for (int k = 0; k < 3; ++k) trial[k].v = logarithms ? T(0.5) * logarithm<T>(stretch2[k]) : square_root(stretch2[k]);
  mapped = trial;
  const Mask<T> flows = Law::update(m, dt, mapped, internal, principal).m;
  if (any(flows)) {
    for (int k = 0; k < 3; ++k)
      ratio[k] = logarithms ? exponential<T>(mapped[k].v - trial[k].v) : mapped[k].v / trial[k].v;
    const LaneMatrix<T> F = product(from_spectrum<T>(U, ratio), s.F);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) s.F.m[r][c] = flows ? F.m[r][c] : s.F.m[r][c];
  }
  const Lanes<T> values[3] = {principal[0].v, principal[1].v, principal[2].v};
  s.tau = from_spectrum<T>(U, values);
}

/// Deformation by the affine velocity C, return mapping, stress and sound speed.
template <typename Law, typename T>
GRAUPEL_LANES void step_material(const MaterialParameters<T>& m, T dt, const LaneMatrix<T>& C, LaneState<T>& s) {
  Pack<T> internal = s.internal;
  s.special = Mask<T>{};
  if constexpr (Law::measure == Measure::volume_ratio) {
    internal = Law::volume_ratio(packed<T>(increment_of(C, dt)), internal);
    LaneSymmetric<T>& tau = s.tau;
    const Lanes<T> mean = Law::mean_stress(m, internal).v;
    for (int k = 0; k < 6; ++k) tau.s[k] = k < 3 ? mean : Lanes<T>{};
    if (m.viscosity > T(0)) {
      const LaneSymmetric<T> viscous = symmetric_part<T>(viscous_stress(m, packed<T>(C), internal));
      for (int k = 0; k < 6; ++k) tau.s[k] += viscous.s[k];
    }
  } else {
    s.F = product(increment_of(C, dt), s.F);
    if constexpr (Law::measure == Measure::deformation)
      s.tau = symmetric_part<T>(Law::update(m, packed<T>(s.F), internal));
    else
      map_principal<Law>(m, dt, s, internal);
  }
  s.internal = internal.v;
  s.sound_speed = larger(Law::sound_speed(m, packed<T>(s.F), internal).v, splat(m.elastic_speed));
}

}  // namespace
}  // namespace graupel::mpm
