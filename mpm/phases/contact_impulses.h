// The momentum that particles and nodes give to obstacles and walls in a substep, found beside the phases that take it
// from them, which stay as they are.
#pragma once

#include <vector>

#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// Of one obstacle or wall.
struct ContactImpulse {
  double impulse[3] = {0, 0, 0};  ///< [N s]
  double moment[3] = {0, 0, 0};   ///< about the origin of the world [N m s]

  GRAUPEL_HD void add(const Vec3d& x, const Vec3d& given) {
    const Vec3d arm = cross(x, given);
    for (int d = 0; d < 3; ++d) {
      impulse[d] += given[d];
      moment[d] += arm[d];
    }
  }
  GRAUPEL_HD void merge(const ContactImpulse& o) {
    for (int d = 0; d < 3; ++d) {
      impulse[d] += o.impulse[d];
      moment[d] += o.moment[d];
    }
  }
};

/// What the grid update that follows takes from the nodes: view.nodes holds momentum and mass. Returns [obstacles of
/// the scene, then two walls an axis]; sums in f64, the same for any number of threads. `records` is storage.
template <typename T>
std::vector<ContactImpulse> node_contact_impulses(const SolverView<T>& view, int32_t obstacles, T dt,
                                                  Buffer<ContactImpulse>& records);
/// What move_particles() that follows takes from the particles that it keeps out of obstacles and walls.
template <typename T>
std::vector<ContactImpulse> push_out_impulses(const SolverView<T>& view, int32_t obstacles, T dt,
                                              Buffer<ContactImpulse>& records);

}  // namespace graupel::mpm
