// Deformation, return mapping and stress, particle by particle. On the CPU its tuned twin
// update_deformation_tiles.cpp takes 16 particles at a time.
#include "mpm/phases/update_particle.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct UpdateParticle {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t slot) const { update_particle(view, dt, slot); }
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
