// The part of the affine velocity that a transfer scheme carries on. APIC keeps all (and does not come here). Called
// after the deformation has used C.
#include "mpm/phases/phases.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct BlendParticle {
  SolverView<T> view;
  CarriedAffine<T> carried;
  GRAUPEL_HD void operator()(int64_t slot) const {
    store_matrix<T, 3>(view.particles.affine_velocity, slot,
                       carried(load_matrix<T, 3>(view.particles.affine_velocity, slot)));
  }
};

}  // namespace

template <typename T>
void blend_affine(const SolverView<T>& view, T symmetric, T rotation) {
  launch<T>(view.device, view.particles.count, BlendParticle<T>{view, {false, symmetric, rotation}}, Grain{1024});
}

template void blend_affine<float>(const SolverView<float>&, float, float);
template void blend_affine<double>(const SolverView<double>&, double, double);

}  // namespace graupel::mpm
