// The part of the affine velocity that a transfer scheme carries on: C <- a sym(C) + b skew(C). APIC keeps both (and
// does not come here), RPIC the rotation (Jiang et al. 2015), PIC nothing. Called after the deformation has used C.
#include "mpm/phases/phases.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct BlendParticle {
  SolverView<T> view;
  T symmetric, rotation;
  GRAUPEL_HD void operator()(int64_t slot) const {
    const Mat<T, 3> C = load_matrix<T, 3>(view.particles.affine_velocity, slot), transposed = transpose(C);
    store_matrix<T, 3>(view.particles.affine_velocity, slot,
                       (T(0.5) * symmetric) * (C + transposed) + (T(0.5) * rotation) * (C - transposed));
  }
};

}  // namespace

template <typename T>
void blend_affine(const SolverView<T>& view, T symmetric, T rotation) {
  launch<T>(view.device, view.particles.count, BlendParticle<T>{view, symmetric, rotation}, Grain{1024});
}

template void blend_affine<float>(const SolverView<float>&, float, float);
template void blend_affine<double>(const SolverView<double>&, double, double);

}  // namespace graupel::mpm
