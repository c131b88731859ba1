// Advection, projection out of obstacles, home blocks, and the survey of the new state; and the copying of particles
// into another order.
#include "mpm/particle_motion.h"
#include "mpm/phases.h"

namespace graupel::mpm {

namespace {

/// Slots of one item: neighbours on the CPU, strided on a GPU so that neighbouring items read neighbouring slots.
struct SlotRange {
  int64_t items, slots_per_item, slots;
  bool strided;

  GRAUPEL_HD int64_t slot(int64_t item, int64_t i) const {
    return strided ? i * items + item : item * slots_per_item + i;
  }
};

SlotRange make_range(Device device, int64_t slots) {
  int64_t per_item = 512;
  if (device != Device::cpu) per_item = slots < 8192 * 64 ? slots / 8192 + 1 : 64;
  return {(slots + per_item - 1) / per_item, per_item, slots, device != Device::cpu};
}

template <typename T>
GRAUPEL_HD inline void survey_slot(const SolverView<T>& view, int64_t slot, T dt, Survey& found) {
  const ParticleView<T>& p = view.particles;
  const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
  const Mat<T, 3> F =
      sound_speed_needs_deformation(m.model) ? load_matrix<T, 3>(p.deformation_gradient, slot) : Mat<T, 3>{};
  survey_state(view.grid.dx, m, slot, p.velocity.vec(slot), F, p.internal.get(slot), dt, found);
}

template <typename T>
struct SurveySlots {
  SolverView<T> view;
  SlotRange range;
  Survey* records;
  GRAUPEL_HD void operator()(int64_t item) const {
    Survey found;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot < range.slots) survey_slot(view, slot, T(0), found);
    }
    records[item] = found;
  }
};

template <typename T>
struct MoveSlots {
  SolverView<T> view;
  SlotRange range;
  Survey* records;
  T dt;

  GRAUPEL_HD void operator()(int64_t item) const {
    Survey found;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot >= range.slots) break;
      move(slot, found);
      survey_slot(view, slot, dt, found);
    }
    records[item] = found;
  }

  GRAUPEL_HD void move(int64_t slot, Survey& found) const {
    const ParticleView<T>& p = view.particles;
    if (view.is_stationary(slot)) return;
    const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
    const Vec<T, 3> before = p.position.vec(slot), velocity = p.velocity.vec(slot);
    Vec<T, 3> x = before, v = velocity;
    move_point(view, slot, m.density * p.volume.get(slot), dt, x, v, found);
    if (!(v == velocity)) p.velocity.set_vec(slot, v);
    if (!(x == before)) p.position.set_vec(slot, x);
    const int32_t key = home_key(view.grid, x);
    if (key != view.keys[slot]) {
      view.keys[slot] = key;
      mark(view.keys_changed);
    }
  }
};

/// Merges every `fold` records into one, in order.
struct MergeRecords {
  const Survey* from;
  Survey* to;
  int64_t count, fold;
  GRAUPEL_HD void operator()(int64_t item) const {
    Survey sum;
    for (int64_t i = item * fold; i < (item + 1) * fold && i < count; ++i) sum.merge(from[i]);
    to[item] = sum;
  }
};

/// Sum of `count` records. The buffer holds twice as many places.
Survey total(Device device, Buffer<Survey>& records, int64_t count) {
  const Survey* first = records.data();
  std::vector<Survey> host;
  if (device != Device::cpu) {
    constexpr int64_t fold = 32;
    const int64_t merged = (count + fold - 1) / fold;
    parallel_for(device, merged, MergeRecords{records.data(), records.data() + count, count, fold});
    host.resize(static_cast<std::size_t>(merged));
    device_copy(Device::cpu, host.data(), device, records.data() + count, host.size() * sizeof(Survey));
    first = host.data();
    count = merged;
  }
  Survey sum;
  for (int64_t i = 0; i < count; ++i) sum.merge(first[i]);
  return sum;
}

template <typename T>
struct FindHomes {
  SolverView<T> view;
  GRAUPEL_HD void operator()(int64_t slot) const {
    view.keys[slot] = home_key(view.grid, view.particles.position.vec(slot));
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
Survey move_particles(const SolverView<T>& view, T dt, Buffer<Survey>& records) {
  const SlotRange range = make_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  launch<T>(view.device, range.items, MoveSlots<T>{view, range, records.data(), dt}, Grain{2});
  return total(view.device, records, range.items);
}

template <typename T>
Survey survey_particles(const SolverView<T>& view, Buffer<Survey>& records) {
  const SlotRange range = make_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  launch<T>(view.device, range.items, SurveySlots<T>{view, range, records.data()}, Grain{2});
  return total(view.device, records, range.items);
}

template <typename T>
void find_home_blocks(const SolverView<T>& view) {
  launch<T>(view.device, view.particles.count, FindHomes<T>{view}, Grain{4096});
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

#define GRAUPEL_INSTANTIATE(T)                                                 \
  template Survey move_particles<T>(const SolverView<T>&, T, Buffer<Survey>&); \
  template Survey survey_particles<T>(const SolverView<T>&, Buffer<Survey>&);  \
  template void find_home_blocks<T>(const SolverView<T>&);                     \
  template void permute_particles<T>(Particles<T>&, Particles<T>&, const int32_t*);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
