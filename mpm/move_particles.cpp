// Advection, projection out of obstacles, home blocks, and the survey of the new state; and the copying of particles
// into another order.
#include "mpm/bspline.h"
#include "mpm/material.h"
#include "mpm/phases.h"
#include "sparsegrid/push_out.h"

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

/// Whether the state of a particle can go on, and its speeds.
template <typename T>
GRAUPEL_HD inline void survey_particle(const SolverView<T>& view, int64_t slot, T dt, Survey& found) {
  const ParticleView<T>& p = view.particles;
  const MaterialParameters<T>& m = view.materials[p.material.get(slot)];
  const T internal = p.internal.get(slot), speed2 = norm2(p.velocity.vec(slot));
  const bool sound_state = internal_variable_is_volume_ratio(m.model) ? internal > T(0) : internal == internal;
  if (!(speed2 < T(1e30)) || !sound_state) {
    if (found.bad_slot < 0 || slot < found.bad_slot) found.bad_slot = slot;
    return;
  }
  if (static_cast<double>(speed2) > found.largest_speed2) found.largest_speed2 = static_cast<double>(speed2);
  const Mat<T, 3> F =
      sound_speed_needs_deformation(m.model) ? load_matrix<T, 3>(p.deformation_gradient, slot) : Mat<T, 3>{};
  const T c = sound_speed(m, F, internal);
  if (static_cast<double>(c) > found.largest_sound_speed) found.largest_sound_speed = static_cast<double>(c);
  if (c * dt > view.grid.dx) ++found.over_courant;
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
      if (slot < range.slots) survey_particle(view, slot, T(0), found);
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
      survey_particle(view, slot, dt, found);
    }
    records[item] = found;
  }

  GRAUPEL_HD void move(int64_t slot, Survey& found) const {
    const ParticleView<T>& p = view.particles;
    if (view.is_stationary(slot)) return;
    const Vec<T, 3> before = p.position.vec(slot), step = dt * p.velocity.vec(slot);
    for (int d = 0; d < 3; ++d)
      if (!(std::abs(step[d]) <= view.grid.dx)) {  // also NaN: such a particle stays where it is
        if (found.bad_slot < 0 || slot < found.bad_slot) found.bad_slot = slot;
        return;
      }
    const Vec<T, 3> wanted = before + step;
    Vec<T, 3> x = wanted;
    for (int d = 0; d < 3; ++d) {
      x[d] = x[d] < view.walls.particle_low[d] ? view.walls.particle_low[d] : x[d];
      x[d] = x[d] > view.walls.particle_high[d] ? view.walls.particle_high[d] : x[d];
    }
    if (view.push_out && near_surface(x, norm(step)))
      sparsegrid::push_out(view.obstacle_nodes.obstacles, view.walls.particle_low, view.walls.particle_high, before, x);
    if (!(x == wanted)) stop_at_surface(slot, x - wanted, found);
    p.position.set_vec(slot, x);
    const int32_t key = home_key(x);
    if (key != view.keys[slot]) {
      view.keys[slot] = key;
      mark(view.keys_changed);
    }
  }

  GRAUPEL_HD int32_t home_key(const Vec<T, 3>& x) const {
    Vec<int, 3> block = base_node(view.grid.local(x));
    for (int d = 0; d < 3; ++d) block[d] /= block_width;
    return view.grid.directory_index(block);
  }

  /// From the signed distance at the nearest node, which phi at x can differ from by at most the distance between them:
  /// whether a way of length `step` that ends at x may have met a surface.
  GRAUPEL_HD bool near_surface(const Vec<T, 3>& x, T step) const {
    const ObstacleNodeView<T>& o = view.obstacle_nodes;
    if (o.obstacles.count == 0) return false;
    const Vec<T, 3> local = view.grid.local(x);
    Vec<int, 3> block;
    int inside = 0;
    for (int d = 0; d < 3; ++d) {
      const int node = static_cast<int>(local[d] + T(0.5));
      block[d] = node / block_width;
      inside = inside * block_width + node % block_width;
    }
    const int32_t number = o.block_number[view.grid.directory_index(block)];
    if (number == block_without_surface) return false;
    return o.phi[int64_t(number) * nodes_per_block<3> + inside] < T(1.3) * view.grid.dx + step;
  }

  /// A particle that was pushed by `push` loses its velocity against that direction, as in an inelastic contact.
  GRAUPEL_HD void stop_at_surface(int64_t slot, const Vec<T, 3>& push, Survey& found) const {
    const ParticleView<T>& p = view.particles;
    ++found.pushed_out;
    const Vec<T, 3> normal = normalized(push), v = p.velocity.vec(slot);
    const T v_n = dot(normal, v);
    if (!(v_n < T(0))) return;
    p.velocity.set_vec(slot, v - v_n * normal);
    const T mass = view.materials[p.material.get(slot)].density * p.volume.get(slot);
    for (int d = 0; d < 3; ++d) found.pushed_momentum[d] += static_cast<double>(-mass * v_n * normal[d]);
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
  MoveSlots<T> mover;
  GRAUPEL_HD void operator()(int64_t slot) const {
    mover.view.keys[slot] = mover.home_key(mover.view.particles.position.vec(slot));
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
  launch<T>(view.device, view.particles.count, FindHomes<T>{{view, {}, nullptr, T(0)}}, Grain{4096});
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
