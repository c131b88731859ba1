// Deformation, return mapping and stress of a particle, by the law of its material.
#pragma once

#include "mpm/materials/material.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

template <typename T>
GRAUPEL_HD inline void update_particle(const SolverView<T>& view, T dt, int64_t slot) {
  const ParticleView<T>& p = view.particles;
  const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
  Mat<T, 3> F = load_matrix<T, 3>(p.deformation_gradient, slot);
  T internal = p.internal.get(slot);
  store_symmetric(p.stress, slot, update_material(m, dt, load_matrix<T, 3>(p.affine_velocity, slot), F, internal));
  p.internal.set(slot, internal);
  store_matrix<T, 3>(p.deformation_gradient, slot, F);
}

}  // namespace graupel::mpm
