// One step of a material by the lanes of the vectorised solver, of particles given as matrices.
#pragma once

#include <array>

#include "mpm/cpu/lanes_materials.h"
#include "mpm/materials/material.h"

namespace graupel::mpm {
namespace {

template <typename T>
struct Particle {
  Mat<T, 3> F = Mat<T, 3>::identity(), tau = Mat<T, 3>::zero();
  T internal = 0, sound_speed = 0;
  bool special = false;  ///< left to the scalar law, with F and the internal variable as they were

  explicit Particle(const MaterialParameters<T>& m) : internal(static_cast<T>(initial_internal_variable(m.model))) {}
};

template <typename T>
void step_by_scalars(const MaterialParameters<T>& m, T dt, const Mat<T, 3>& C, Particle<T>& p) {
  p.tau = update_material(m, dt, C, p.F, p.internal);
  p.sound_speed = sound_speed(m, p.F, p.internal);
}

/// Each particle with its own affine velocity, as many as there are lanes.
template <typename T>
void step_by_lanes(const MaterialParameters<T>& m, T dt, const std::array<Mat<T, 3>, width<T>>& C,
                   std::array<Particle<T>*, width<T>> particles) {
  LaneState<T> state;
  LaneMatrix<T> rate;
  for (int l = 0; l < width<T>; ++l) {
    state.internal[l] = particles[l]->internal;
    for (int k = 0; k < 9; ++k) {
      state.F.m[k / 3][k % 3][l] = particles[l]->F(k / 3, k % 3);
      rate.m[k / 3][k % 3][l] = C[l](k / 3, k % 3);
    }
  }
  with_law(m.model, [&](auto law) {
    using Law = decltype(law);
    if constexpr (Law::measure != Measure::nothing) step_material<Law>(m, dt, rate, state);
  });
  for (int l = 0; l < width<T>; ++l) {
    Particle<T>& p = *particles[l];
    p.special = state.special[l] != 0;
    if (p.special) continue;
    p.internal = state.internal[l];
    p.sound_speed = state.sound_speed[l];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        if (keeps_deformation(m.model)) p.F(r, c) = state.F.m[r][c][l];
        p.tau(r, c) = state.tau.s[symmetric_entry(r < c ? r : c, r < c ? c : r)][l];
      }
  }
}

/// The same of one particle in all lanes, and by the scalar law where that is left to it.
template <typename T>
void step_by_equal_lanes(const MaterialParameters<T>& m, T dt, const Mat<T, 3>& C, Particle<T>& p) {
  if (m.model == MaterialModel::stationary) return step_by_scalars(m, dt, C, p);
  std::array<Mat<T, 3>, width<T>> rates;
  rates.fill(C);
  std::array<Particle<T>*, width<T>> particles;
  particles.fill(&p);
  step_by_lanes(m, dt, rates, particles);
  if (p.special) step_by_scalars(m, dt, C, p);
}

}  // namespace
}  // namespace graupel::mpm
