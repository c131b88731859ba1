// Deformation, return mapping and stress, particle by particle. On the CPU its tuned twin
// update_deformation_tiles.cpp takes 16 particles at a time.
#include "mpm/materials/material.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct UpdateParticle {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<T>& p = view.particles;
    const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
    Mat<T, 3> F = load_matrix<T, 3>(p.deformation_gradient, slot);
    T internal = p.internal.get(slot);
    store_symmetric(p.stress, slot, update_material(m, dt, load_matrix<T, 3>(p.affine_velocity, slot), F, internal));
    p.internal.set(slot, internal);
    store_matrix<T, 3>(p.deformation_gradient, slot, F);
  }
};

}  // namespace

template <typename T>
void update_deformation_portable(const SolverView<T>& view, T dt) {
  launch<T>(view.device, view.particles.count, UpdateParticle<T>{view, dt});
}

template <typename T>
void update_deformation(const SolverView<T>& view, T dt) {
  if (view.device != Device::cpu) return update_deformation_portable(view, dt);
  update_deformation_tiles(view, dt);
}

template void update_deformation<float>(const SolverView<float>&, float);
template void update_deformation<double>(const SolverView<double>&, double);
template void update_deformation_portable<float>(const SolverView<float>&, float);
template void update_deformation_portable<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
