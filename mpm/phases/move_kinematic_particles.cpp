// Particles that a script leads: they take its velocity and velocity gradient, before they go to the grid, where the
// other particles feel them, and again after they read it, so that they move as the script says. The momentum that
// this gives them is the script's impulse.
#include "mpm/particles/slot_range.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct MoveKinematicSlots {
  SolverView<T> view;
  SlotRange range;
  Impulse* records;

  GRAUPEL_HD void operator()(int64_t item) const {
    Impulse given;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot < range.slots) lead(slot, given);
    }
    records[item] = given;
  }

  GRAUPEL_HD void lead(int64_t slot, Impulse& given) const {
    const ParticleView<T>& p = view.particles;
    const int32_t particle = p.source_index.get(slot);
    const RigidStep<T>* leader = view.lifecycle.leader(particle);
    if (leader == nullptr || !view.lifecycle.is_active(particle)) return;
    const T mass = view.materials[p.material.get(slot)].density * p.volume.get(slot);
    const Vec<T, 3> v = leader->velocity_at(p.position.vec(slot)), change = v - p.velocity.vec(slot);
    for (int d = 0; d < 3; ++d) given.momentum[d] += static_cast<double>(mass * change[d]);
    p.velocity.set_vec(slot, v);
    store_matrix<T, 3>(p.affine_velocity, slot, leader->gradient);
  }
};

}  // namespace

template <typename T>
Vec3d move_kinematic_particles(const SolverView<T>& view, Buffer<Impulse>& records) {
  const SlotRange range = make_slot_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  launch<T>(view.device, range.items, MoveKinematicSlots<T>{view, range, records.data()}, Grain{2});
  const Impulse sum = total(view.device, records, range.items);
  return {sum.momentum[0], sum.momentum[1], sum.momentum[2]};
}

template Vec3d move_kinematic_particles<float>(const SolverView<float>&, Buffer<Impulse>&);
template Vec3d move_kinematic_particles<double>(const SolverView<double>&, Buffer<Impulse>&);

}  // namespace graupel::mpm
