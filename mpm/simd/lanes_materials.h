// One step of water, jelly, snow and sand, a particle in every lane; the laws are those of mpm/materials/.
// Snow and sand need no right rotation: with b = F F^T = U diag(s^2) U^T, a return map of the singular values s -> s'
// is F <- U diag(s'/s) U^T F.
#pragma once

#include "mpm/material_parameters.h"
#include "mpm/simd/lanes_math.h"
#include "mpm/simd/lanes_matrix.h"

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

template <typename T>
GRAUPEL_LANES Lanes<T> at_least(Lanes<T> c, T bound) {
  return larger(c, splat(bound));
}

template <typename T>
GRAUPEL_LANES void step_water(const MaterialParameters<T>& m, T dt, const LaneMatrix<T>& C, LaneState<T>& s) {
  const Lanes<T> J = determinant_of(increment_of(C, dt)) * s.internal;
  s.internal = J;
  Lanes<T> stress;
  if (m.equation_of_state == EquationOfState::linear) {
    stress = m.bulk_modulus * J * (J - T(1));
    s.sound_speed = at_least(J * m.elastic_speed, m.elastic_speed);
  } else {
    // A lane with J <= 0 is bad, and the survey finds it.
    const Lanes<T> log_J = logarithm<T>(larger(J, splat(T(1e-30))));
    stress = m.bulk_modulus / m.tait_exponent * J * (T(1) - exponential<T>(-m.tait_exponent * log_J));
    const Lanes<T> growth = exponential<T>(T(0.5) * (T(1) - m.tait_exponent) * log_J);
    s.sound_speed = at_least(m.elastic_speed * growth, m.elastic_speed);
  }
  for (int k = 0; k < 3; ++k) s.tau.s[k] = stress;
  for (int k = 3; k < 6; ++k) s.tau.s[k] = Lanes<T>{};
  if (m.viscosity > T(0)) {
    const Lanes<T> scale = m.viscosity * J, mean = T(2) / T(3) * (C.m[0][0] + C.m[1][1] + C.m[2][2]);
    for (int r = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c) {
        const Lanes<T> rate = C.m[r][c] + C.m[c][r];
        s.tau.s[symmetric_entry(r, c)] += scale * (r == c ? rate - mean : rate);
      }
  }
}

template <typename T>
GRAUPEL_LANES void step_jelly(const MaterialParameters<T>& m, T dt, const LaneMatrix<T>& C, LaneState<T>& s) {
  s.F = product(increment_of(C, dt), s.F);
  const LaneMatrix<T>& F = s.F;
  const Lanes<T> J = determinant_of(F), pressure = m.lambda * J * (J - T(1));
  s.internal = J;
  LaneMatrix<T> strain = rotation_of(F);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) strain.m[r][c] = T(2) * m.mu * (F.m[r][c] - strain.m[r][c]);
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) {
      const Lanes<T> t = strain.m[r][0] * F.m[c][0] + strain.m[r][1] * F.m[c][1] + strain.m[r][2] * F.m[c][2];
      s.tau.s[symmetric_entry(r, c)] = r == c ? t + pressure : t;
    }
  const Lanes<T> stretch2 = squares(F) - T(2);
  s.sound_speed = m.elastic_speed * square_root(at_least(larger(stretch2, J * J), T(1)));
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

/// h(J_p).
template <typename T>
GRAUPEL_LANES Lanes<T> hardening_of(const MaterialParameters<T>& m, Lanes<T> J_p) {
  const Lanes<T> h = exponential<T>(m.hardening * (T(1) - J_p));
  return m.max_hardening > T(0) ? smaller(h, splat(m.max_hardening)) : h;
}

template <typename T>
GRAUPEL_LANES void step_snow(const MaterialParameters<T>& m, T dt, const LaneMatrix<T>& C, LaneState<T>& s) {
  s.F = product(increment_of(C, dt), s.F);
  Lanes<T> stretch2[3], ratio[3], sigma[3];
  const LaneMatrix<T> U = decompose(s, stretch2);
  const T low = T(1) - m.critical_compression, high = T(1) + m.critical_stretch;
  const Lanes<T> J_p = s.internal;
  Lanes<T> growth = splat(T(1));
  for (int k = 0; k < 3; ++k) {
    const Lanes<T> trial = square_root(stretch2[k]);
    sigma[k] = smaller(larger(trial, splat(low)), splat(high));
    ratio[k] = sigma[k] / trial;
    growth *= ratio[k];
  }
  const Mask<T> clamped = (ratio[0] != T(1)) | (ratio[1] != T(1)) | (ratio[2] != T(1));
  const bool before = m.hardening_update == HardeningUpdate::before;
  const Lanes<T> h_before = before ? hardening_of(m, J_p) : J_p;
  if (any(clamped)) {
    s.internal = clamped ? J_p / growth : J_p;
    const LaneMatrix<T> mapped = product(from_spectrum<T>(U, ratio), s.F);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) s.F.m[r][c] = clamped ? mapped.m[r][c] : s.F.m[r][c];
  }
  const Lanes<T> h_after = hardening_of(m, s.internal), h = before ? h_before : h_after;
  s.sound_speed = at_least(m.elastic_speed * square_root(h_after), m.elastic_speed);
  const Lanes<T> J = sigma[0] * sigma[1] * sigma[2], pressure = m.lambda * J * (J - T(1));
  Lanes<T> principal[3];
  for (int k = 0; k < 3; ++k) principal[k] = h * (T(2) * m.mu * (sigma[k] - T(1)) * sigma[k] + pressure);
  s.tau = from_spectrum<T>(U, principal);
}

/// sand_return_mapping() of every lane: strain, v_c -> change of strain; returns the lanes where it is not 0.
template <typename T>
GRAUPEL_LANES Mask<T> map_sand(const MaterialParameters<T>& m, Lanes<T> (&strain)[3], Lanes<T>& v_c,
                               Lanes<T> (&change)[3]) {
  const Lanes<T> trial[3] = {strain[0], strain[1], strain[2]};
  Lanes<T> sum = strain[0] + strain[1] + strain[2];
  Mask<T> changed = Mask<T>{};
  if (m.volume_correction == VolumeCorrection::klar) {
    changed = v_c != T(0);
    for (int k = 0; k < 3; ++k) strain[k] += v_c / T(3);
    sum = strain[0] + strain[1] + strain[2];
  } else if (m.volume_correction == VolumeCorrection::taichi) {
    sum += v_c;
  }
  const T bulk = m.lambda + T(2) * m.mu / T(3);
  const Mask<T> apart = bulk * sum >= (v_c > T(0) ? Lanes<T>{} : splat(m.tension_limit));
  v_c = m.volume_correction != VolumeCorrection::none ? (apart ? sum : Lanes<T>{}) : Lanes<T>{};
  const Lanes<T> mean = sum / T(3);
  const Lanes<T> deviator[3] = {strain[0] - mean, strain[1] - mean, strain[2] - mean};
  const Lanes<T> length =
      square_root(deviator[0] * deviator[0] + deviator[1] * deviator[1] + deviator[2] * deviator[2]);
  const Lanes<T> excess = length + T(3) * bulk / (T(2) * m.mu) * m.friction * sum - m.cohesion_length;
  const Mask<T> yields = excess > T(0);
  const Lanes<T> share = yields ? excess / length : Lanes<T>{};
  for (int k = 0; k < 3; ++k) {
    strain[k] = apart ? Lanes<T>{} : strain[k] - share * deviator[k];
    change[k] = strain[k] - trial[k];
  }
  return changed | apart | yields;
}

template <typename T>
GRAUPEL_LANES void step_sand(const MaterialParameters<T>& m, T dt, const LaneMatrix<T>& C, LaneState<T>& s) {
  s.F = product(increment_of(C, dt), s.F);
  Lanes<T> strain[3], change[3];
  const LaneMatrix<T> U = decompose(s, strain);
  for (int k = 0; k < 3; ++k) strain[k] = T(0.5) * logarithm<T>(strain[k]);
  const Mask<T> changed = map_sand<T>(m, strain, s.internal, change);
  if (any(changed)) {
    for (int k = 0; k < 3; ++k) change[k] = exponential<T>(change[k]);
    const LaneMatrix<T> mapped = product(from_spectrum<T>(U, change), s.F);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) s.F.m[r][c] = changed ? mapped.m[r][c] : s.F.m[r][c];
  }
  s.sound_speed = splat(m.elastic_speed);
  const Lanes<T> sum = strain[0] + strain[1] + strain[2];
  Lanes<T> principal[3];
  for (int k = 0; k < 3; ++k) principal[k] = T(2) * m.mu * strain[k] + m.lambda * sum;
  s.tau = from_spectrum<T>(U, principal);
}

}  // namespace
}  // namespace graupel::mpm
