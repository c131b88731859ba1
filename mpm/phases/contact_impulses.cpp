// Contact is worked out a second time, with the functions of the phase that follows, and what it takes is summed by
// obstacle and wall: items each fill a row of a table, whose rows are merged in order. So runs that ask for no forces
// have the kernels that they had.
#include "mpm/phases/contact_impulses.h"

#include <algorithm>

#include "mpm/particles/slot_range.h"
#include "mpm/phases/periodic_nodes.h"
#include "mpm/physics/acting_obstacle.h"
#include "mpm/physics/exits.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm {

namespace {

/// A row an item of `range`, with one record for each obstacle and then each wall.
struct ContactTable {
  SlotRange range;  ///< of slots, or of node blocks
  int32_t obstacles, surfaces;
  ContactImpulse* records;

  GRAUPEL_HD ContactImpulse* cleared_row(int64_t row) const {
    ContactImpulse* records_of_row = records + row * surfaces;
    for (int32_t s = 0; s < surfaces; ++s) records_of_row[s] = ContactImpulse{};
    return records_of_row;
  }
  GRAUPEL_HD int32_t wall(int axis, int side) const { return obstacles + 2 * axis + side; }
};

/// m (before - after): what is given to the surface that changed a velocity.
template <typename T>
GRAUPEL_HD inline Vec3d impulse_of(T mass, const Vec<T, 3>& before, const Vec<T, 3>& after) {
  return static_cast<double>(mass) * (before.template cast<double>() - after.template cast<double>());
}

template <typename T, int D, bool some_move>
struct SumNodes {
  SolverView<T> view;
  ContactTable table;
  T dt;

  GRAUPEL_HD void operator()(int64_t item) const {
    ContactImpulse* sums = table.cleared_row(item);
    for (int64_t i = 0; i < table.range.slots_per_item; ++i) {
      const int64_t block = table.range.slot(item, i);
      if (block >= table.range.slots) break;
      const int32_t key = view.blocks.node_key[block];
      if (!meets_surface(key)) continue;
      for (int inside = 0; inside < nodes_per_block<D>; ++inside)
        add_node(block * nodes_per_block<D> + inside, key, inside, sums);
    }
  }

  /// Whether an obstacle or a wall may act on nodes of a block.
  GRAUPEL_HD bool meets_surface(int32_t key) const {
    const Vec<T, 3> low = node_position<D>(view.grid, key, 0),
                    high = node_position<D>(view.grid, key, nodes_per_block<D> - 1);
    bool meets = view.obstacle_nodes.block_number[key] != block_without_surface;
    for (int d = 0; d < D; ++d)
      meets = meets || wall_side(view.walls, low, view.grid.dx, d) != 0 ||
              wall_side(view.walls, high, view.grid.dx, d) != 0;
    return meets || (some_move && any_within_reach(view.moving, low, high, view.grid.dx));
  }

  GRAUPEL_HD void add_node(int64_t entry, int32_t key, int inside, ContactImpulse* sums) const {
    const T* node = view.nodes + entry * channels;
    const T mass = node[3];
    if (!(mass >= least_node_mass<T>) || !is_first_image(entry, key, inside)) return;
    const Vec<T, 3> x = node_position<D>(view.grid, key, inside);
    const Vec3d place = x.template cast<double>();
    const Vec<T, 3> before = free_velocity(Vec<T, 3>{node[0], node[1], node[2]}, T(1) / mass, dt * view.gravity);
    Vec<T, 3> v = apply_obstacles<some_move, D>(view, view.moving, key, inside, x, before);
    if (!(v == before)) {
      const int32_t obstacle = acting_obstacle<some_move, D>(view, view.moving, key, inside, x);
      if (obstacle >= 0) sums[obstacle].add(place, impulse_of(mass, before, v));
    }
    for (int d = 0; d < D; ++d) {
      const int side = wall_side(view.walls, x, view.grid.dx, d) - 1;
      if (side < 0) continue;
      const Vec<T, 3> after =
          apply_contact(view.walls.contact[d][side], view.walls.friction[d][side], wall_normal<T>(d, side), v);
      sums[table.wall(d, side)].add(place, impulse_of(mass, v, after));
      v = after;
    }
  }

  /// Of the images of a node behind periodic walls, which hold the same sums, one counts.
  GRAUPEL_HD bool is_first_image(int64_t entry, int32_t key, int inside) const {
    if (view.blocks.node_of_key == nullptr) return true;
    int64_t first = -1;
    for_images<D>(view, key, inside, [&](int64_t image) { first = first < 0 ? image : first; });
    return first == entry;
  }
};

/// `plain` as in move_particles().
template <typename T, int D, bool plain>
struct SumPushes {
  SolverView<T> view;
  ContactTable table;
  T dt;

  GRAUPEL_HD void operator()(int64_t item) const {
    ContactImpulse* sums = table.cleared_row(item);
    for (int64_t i = 0; i < table.range.slots_per_item; ++i) {
      const int64_t slot = table.range.slot(item, i);
      if (slot < table.range.slots) add_particle(slot, sums);
    }
  }

  GRAUPEL_HD void add_particle(int64_t slot, ContactImpulse* sums) const {
    const ParticleView<T>& p = view.particles;
    const int32_t particle = p.source_index.get(slot);
    const Vec<T, 3> v = p.velocity.vec(slot);
    Vec<T, 3> x = p.position.vec(slot), slowed = v;
    if (!plain && view.keys[slot] == no_owner && !is_born(particle, v, x)) return;
    const bool kinematic = !plain && view.lifecycle.script != nullptr && view.lifecycle.leader(particle) != nullptr;
    if (kinematic || view.is_stationary(slot)) return;
    const Vec<T, 3> step = dt * v;
    Vec<T, 3> wanted;
    for (int d = 0; d < 3; ++d) wanted[d] = rounded_sum(x[d], step[d]);
    const T mass = view.materials[p.material.get(slot)].density * p.volume.get(slot);
    StepStatistics found;
    move_point<!plain, D, T>(view, view.moving, false, slot, mass, dt, x, slowed, found);
    if (found.pushed_out > 0 && !(slowed == v)) share(wanted, x, impulse_of(mass, v, slowed), sums);
  }

  GRAUPEL_HD bool is_born(int32_t particle, const Vec<T, 3>& v, Vec<T, 3>& x) const {
    return view.lifecycle.presence[particle] == Presence::unborn &&
           appears(view.lifecycle.step_end, view.lifecycle.birth_time[particle], dt, v, x);
  }

  /// The impulse goes along the way from where a particle wanted to be to x, where it was put: the part along each
  /// wall's push to that wall, the rest to the obstacle.
  GRAUPEL_HD void share(const Vec<T, 3>& wanted, const Vec<T, 3>& x, const Vec3d& given, ContactImpulse* sums) const {
    const Vec<T, 3> walled = inside_walls(view.walls, wanted);
    const Vec3d place = x.template cast<double>();
    const Vec3d push = (x - wanted).template cast<double>(), of_walls = (walled - wanted).template cast<double>();
    const double along = norm(given) / norm(push);
    Vec3d left = given;
    for (int d = 0; d < D; ++d) {
      if (of_walls[d] == 0) continue;
      Vec3d part = Vec3d::zero();
      part[d] = walled == x ? given[d] : -along * of_walls[d];
      left -= part;
      sums[table.wall(d, of_walls[d] > 0 ? 0 : 1)].add(place, part);
    }
    if (walled == x) return;
    const int32_t obstacle = pushing_obstacle<!plain>(view, view.moving, walled);
    if (obstacle >= 0) sums[obstacle].add(place, left);
  }
};

/// Merges every `fold` rows into one, in order.
struct MergeRows {
  ContactTable from;
  ContactImpulse* to;
  int64_t fold;

  GRAUPEL_HD void operator()(int64_t item) const {
    const int64_t first = item / from.surfaces * fold, surface = item % from.surfaces;
    ContactImpulse sum;
    for (int64_t row = first; row < first + fold && row < from.range.items; ++row)
      sum.merge(from.records[row * from.surfaces + surface]);
    to[item] = sum;
  }
};

std::vector<ContactImpulse> sum_of_rows(Device device, const ContactTable& table) {
  const auto surfaces = static_cast<std::size_t>(table.surfaces);
  const ContactImpulse* records = table.records;
  auto count = static_cast<std::size_t>(table.range.items) * surfaces;
  std::vector<ContactImpulse> host;
  if (device != Device::cpu) {
    constexpr int64_t fold = 32;
    ContactImpulse* const merged = table.records + count;
    const int64_t rows = (table.range.items + fold - 1) / fold;
    parallel_for(device, rows * table.surfaces, MergeRows{table, merged, fold});
    host.resize(static_cast<std::size_t>(rows) * surfaces);
    device_copy(Device::cpu, host.data(), device, merged, host.size() * sizeof(ContactImpulse));
    records = host.data();
    count = host.size();
  }
  std::vector<ContactImpulse> sums(surfaces);
  for (std::size_t i = 0; i < count; ++i) sums[i % surfaces].merge(records[i]);
  return sums;
}

/// Runs Sum over `slots` slots or node blocks, about `per_item` of them in a row of the table, and adds the rows up.
template <typename T, template <typename, int, bool> typename Sum, int D, bool flag>
std::vector<ContactImpulse> summed(const SolverView<T>& view, int32_t obstacles, T dt, int64_t slots, int64_t per_item,
                                   Buffer<ContactImpulse>& records) {
  constexpr int64_t most_records = 16384;
  const int32_t surfaces = obstacles + 2 * view.dimensions;
  const int64_t items = std::clamp<int64_t>(slots / per_item, 1, std::max<int64_t>(1, most_records / surfaces));
  records.resize_discard(static_cast<std::size_t>(2 * items * surfaces));
  const SlotRange range{items, (slots + items - 1) / items, slots, view.device != Device::cpu};
  const ContactTable table{range, obstacles, surfaces, records.data()};
  launch<T>(view.device, items, Sum<T, D, flag>{view, table, dt}, Grain{1});
  return sum_of_rows(view.device, table);
}

}  // namespace

template <typename T>
std::vector<ContactImpulse> node_contact_impulses(const SolverView<T>& view, int32_t obstacles, T dt,
                                                  Buffer<ContactImpulse>& records) {
  const int64_t blocks = view.blocks.node_count, per_item = view.device == Device::cpu ? 8 : 1;
  const bool some_move = view.moving.count > 0;
  if (view.dimensions == 2)
    return some_move ? summed<T, SumNodes, 2, true>(view, obstacles, dt, blocks, per_item, records)
                     : summed<T, SumNodes, 2, false>(view, obstacles, dt, blocks, per_item, records);
  return some_move ? summed<T, SumNodes, 3, true>(view, obstacles, dt, blocks, per_item, records)
                   : summed<T, SumNodes, 3, false>(view, obstacles, dt, blocks, per_item, records);
}

template <typename T>
std::vector<ContactImpulse> push_out_impulses(const SolverView<T>& view, int32_t obstacles, T dt,
                                              Buffer<ContactImpulse>& records) {
  const int64_t slots = view.particles.count, per_item = view.device == Device::cpu ? 512 : 16;
  if (view.dimensions == 2) return summed<T, SumPushes, 2, false>(view, obstacles, dt, slots, per_item, records);
  return moves_plainly(view) ? summed<T, SumPushes, 3, true>(view, obstacles, dt, slots, per_item, records)
                             : summed<T, SumPushes, 3, false>(view, obstacles, dt, slots, per_item, records);
}

#define GRAUPEL_INSTANTIATE(T)                                                                    \
  template std::vector<ContactImpulse> node_contact_impulses<T>(const SolverView<T>&, int32_t, T, \
                                                                Buffer<ContactImpulse>&);         \
  template std::vector<ContactImpulse> push_out_impulses<T>(const SolverView<T>&, int32_t, T, Buffer<ContactImpulse>&);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
