// Advection, projection out of obstacles, passage of open and periodic walls, births and sinks, owner blocks, and the
// step_statistics of the new state; and the copying of particles into another order.
#include "mpm/particles/slot_range.h"
#include "mpm/phases/phases.h"
#include "mpm/physics/exits.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm {

namespace {

/// Inlined into each form of the mover: as a call, which compilers choose where there are many forms, other products
/// are fused with sums, and the last bits of a run change.
template <typename T>
[[gnu::always_inline]] GRAUPEL_HD inline void add_to_statistics(const SolverView<T>& view, int64_t slot, T dt,
                                                                StepStatistics& found) {
  const ParticleView<T>& p = view.particles;
  const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
  const Mat<T, 3> F =
      sound_speed_needs_deformation(m.model) ? load_matrix<T, 3>(p.deformation_gradient, slot) : Mat<T, 3>{};
  state_statistics(view.grid.dx, m, slot, p.velocity.vec(slot), F, p.internal.get(slot), dt, found);
}

template <typename T>
struct SurveySlots {
  SolverView<T> view;
  SlotRange range;
  StepStatistics* records;
  GRAUPEL_HD void operator()(int64_t item) const {
    StepStatistics found;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot < range.slots && view.keys[slot] != no_owner) add_to_statistics(view, slot, T(0), found);
    }
    records[item] = found;
  }
};

/// `plain` (in space only): nothing moves but the particles, and none comes or goes; tests of all that cost water 3%
/// where they were made for every particle.
template <typename T, bool plain, int D>
struct MoveSlots {
  SolverView<T> view;
  SlotRange range;
  StepStatistics* records;
  T dt;

  GRAUPEL_HD void operator()(int64_t item) const {
    StepStatistics found;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot >= range.slots) break;
      if (!plain && view.keys[slot] == no_owner && !appear(slot, found)) continue;
      if (move(slot, found)) add_to_statistics(view, slot, dt, found);
    }
    records[item] = found;
  }

  /// A particle whose time of birth falls into this substep.
  GRAUPEL_HD bool appear(int64_t slot, StepStatistics& found) const {
    const ParticleView<T>& p = view.particles;
    const int32_t particle = p.source_index.get(slot);
    if (view.lifecycle.presence[particle] != Presence::unborn) return false;
    Vec<T, 3> x = p.position.vec(slot);
    const LifecycleView<T>& lifecycle = view.lifecycle;
    if (!appears(lifecycle.step_end, lifecycle.birth_time[particle], dt, p.velocity.vec(slot), x)) return false;
    view.lifecycle.presence[particle] = Presence::active;
    p.position.set_vec(slot, x);
    ++found.born;
    return true;
  }

  /// False for a particle that is gone.
  GRAUPEL_HD bool move(int64_t slot, StepStatistics& found) const {
    const ParticleView<T>& p = view.particles;
    const bool kinematic =
        !plain && view.lifecycle.script != nullptr && view.lifecycle.leader(p.source_index.get(slot)) != nullptr;
    if (!kinematic && view.is_stationary(slot)) {
      settle(slot, p.position.vec(slot));
      return true;
    }
    const Vec<T, 3> v = p.velocity.vec(slot);
    Vec<T, 3> x = p.position.vec(slot), slowed = v;
    const T mass = view.materials[p.material.get(slot)].density * p.volume.get(slot);
    if (!move_point<!plain, D, T>(view, view.moving, kinematic, slot, mass, dt, x, slowed, found)) return true;
    if (!(slowed == v)) p.velocity.set_vec(slot, slowed);
    if (!plain && !kinematic && has_exits(view.walls, view.lifecycle) &&
        leaves(view.walls, view.lifecycle, view.grid.dx, x)) {
      remove(slot, x, found);
      return false;
    }
    p.position.set_vec(slot, x);
    settle(slot, x);
    return true;
  }

  /// Brings the owner block of a particle at x up to date.
  GRAUPEL_HD void settle(int64_t slot, const Vec<T, 3>& x) const {
    const int32_t key = owner_key(view.grid, x, static_cast<T>(base_shift(view.spline)));
    if (key == view.keys[slot]) return;
    view.keys[slot] = key;
    mark(view.keys_changed);
  }

  GRAUPEL_HD void remove(int64_t slot, const Vec<T, 3>& x, StepStatistics& found) const {
    const ParticleView<T>& p = view.particles;
    view.lifecycle.presence[p.source_index.get(slot)] = Presence::gone;
    p.position.set_vec(slot, x);
    p.velocity.set_vec(slot, Vec<T, 3>::zero());
    store_matrix<T, 3>(p.affine_velocity, slot, Mat<T, 3>::zero());
    view.keys[slot] = no_owner;
    mark(view.keys_changed);
    ++found.removed;
  }
};

template <typename T>
struct FindOwners {
  SolverView<T> view;
  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<T>& p = view.particles;
    const bool active = view.lifecycle.presence == nullptr || view.lifecycle.is_active(p.source_index.get(slot));
    const T shift = static_cast<T>(base_shift(view.spline));
    view.keys[slot] = active ? owner_key(view.grid, p.position.vec(slot), shift) : no_owner;
  }
};

/// Copies K components of every particle.
template <typename T>
struct Permute {
  const T* from;
  T* to;
  const int32_t* order;
  int components;
  GRAUPEL_HD void operator()(int64_t slot) const {
    const int64_t old = order[slot];
    const T* source = from + (old / tile) * (tile * components) + old % tile;
    T* target = to + (slot / tile) * (tile * components) + slot % tile;
    for (int k = 0; k < components; ++k) target[k * tile] = source[k * tile];
  }
};

}  // namespace

template <typename T>
bool moves_plainly(const SolverView<T>& view) {
  return view.lifecycle.presence == nullptr && view.lifecycle.script == nullptr && view.moving.count == 0 &&
         !view.walls.has_gates;
}

template <typename T>
StepStatistics move_particles(const SolverView<T>& view, T dt, Buffer<StepStatistics>& records) {
  const SlotRange range = make_slot_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  const auto move = [&](auto kernel) {
    launch<T>(view.device, range.items, decltype(kernel){view, range, records.data(), dt}, Grain{2});
  };
  if (view.dimensions == 2)
    move(MoveSlots<T, false, 2>{});
  else if (moves_plainly(view))
    move(MoveSlots<T, true, 3>{});
  else
    move(MoveSlots<T, false, 3>{});
  return total(view.device, records, range.items);
}

template <typename T>
StepStatistics particle_statistics(const SolverView<T>& view, Buffer<StepStatistics>& records) {
  const SlotRange range = make_slot_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  launch<T>(view.device, range.items, SurveySlots<T>{view, range, records.data()}, Grain{2});
  return total(view.device, records, range.items);
}

template <typename T>
void move_slots(const SolverView<T>& view, T dt, int64_t first, int64_t end, StepStatistics& found) {
  const MoveSlots<T, true, 3> mover{view, {}, nullptr, dt};
  for (int64_t slot = first; slot < end; ++slot)
    if (mover.move(slot, found)) add_to_statistics(view, slot, dt, found);
}

template <typename T>
void statistics_slots(const SolverView<T>& view, T dt, int64_t first, int64_t end, StepStatistics& found) {
  for (int64_t slot = first; slot < end; ++slot) add_to_statistics(view, slot, dt, found);
}

template <typename T>
void find_owner_blocks(const SolverView<T>& view) {
  launch<T>(view.device, view.particles.count, FindOwners<T>{view}, Grain{4096});
}

template <typename T>
void permute_particles(Particles<T>& from, Particles<T>& to, const int32_t* order) {
  std::vector<const void*> sources;
  from.for_each_buffer([&](auto& buffer) { sources.push_back(buffer.data()); });
  std::size_t next = 0;
  const int64_t padded = padded_to_tile(from.count());
  to.for_each_buffer([&](auto& buffer) {
    using Value = std::remove_reference_t<decltype(*buffer.data())>;
    const int components = static_cast<int>(static_cast<int64_t>(buffer.size()) / padded);
    launch<T>(from.device(), from.count(),
              Permute<Value>{static_cast<const Value*>(sources[next++]), buffer.data(), order, components},
              Grain{1024});
  });
}

#define GRAUPEL_INSTANTIATE(T)                                                                   \
  template bool moves_plainly<T>(const SolverView<T>&);                                          \
  template void move_slots<T>(const SolverView<T>&, T, int64_t, int64_t, StepStatistics&);       \
  template void statistics_slots<T>(const SolverView<T>&, T, int64_t, int64_t, StepStatistics&); \
  template StepStatistics move_particles<T>(const SolverView<T>&, T, Buffer<StepStatistics>&);   \
  template StepStatistics particle_statistics<T>(const SolverView<T>&, Buffer<StepStatistics>&); \
  template void find_owner_blocks<T>(const SolverView<T>&);                                      \
  template void permute_particles<T>(Particles<T>&, Particles<T>&, const int32_t*);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
