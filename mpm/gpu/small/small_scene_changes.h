// What changes in a small scene during a frame: which particles are in the run, and which nodes moving obstacles hold.
// Those nodes are found once for all particles, a substep ahead, while others wait at the barrier: as each particle met
// them, every one of its 27 nodes would search the obstacle.
#pragma once

#include "mpm/gpu/small/small_scene_contact.h"
#include "mpm/gpu/small/small_scene_worker.h"
#include "mpm/physics/exits.h"

namespace graupel::mpm::small {

template <typename W>
GRAUPEL_HD inline const NodeBox* boxes_in(const W& w, int32_t step) {
  const ChangingScene& scene = w.shared.changing;
  return scene.boxes + int64_t(step) * scene.moving.count;
}

/// The moving obstacles in the present substep.
template <typename W>
GRAUPEL_HD inline const MovingObstacleView<float>& moving_now(const W& w) {
  return w.shared.moving[w.step % 2];
}

/// What holds a node in a substep: the deeper one of the obstacles at rest and the moving ones, as apply_obstacles()
/// has it.
template <typename W>
GRAUPEL_HD inline NodeContact find_moving_contact(const W& w, const MovingObstacleView<float>& moving,
                                                  const Vec<int, 3>& node) {
  const SceneView<float>& scene = w.scene.view;
  int32_t key;
  const int inside = number_in_block(scene.grid, node, key);
  sparsegrid::SignedDistance<float> here{};
  const int32_t index = holding_obstacle<3>(moving, scene.grid.node_position(node), scene.grid.dx, here);
  const ObstacleNodeView<float>& fixed = scene.obstacle_nodes;
  const int32_t surface = fixed.block_number[key];
  const int64_t entry = int64_t(surface) * nodes_per_block<3> + inside;
  const bool fixed_is_deeper =
      surface != block_without_surface && fixed.law[entry] >= 0 && fixed.phi[entry] <= here.phi;
  const NodeContact& unmoved = w.small.contact[place_of(w.small, node)];
  return index < 0 || fixed_is_deeper ? unmoved : held_by(w.small, unmoved, index, here.normal);
}

/// Before the barrier at the start of a substep: its moving obstacles, and the table of its contacts. Neighbouring
/// warps belong to different blocks, so that all blocks take part.
template <typename W>
GRAUPEL_HD void begin_changes(const W& w, int32_t step) {
  const ChangingScene& scene = w.shared.changing;
  const MovingObstacleView<float> moving = scene.moving.later(step);
  if (w.block.thread() == 0) w.shared.moving[step % 2] = moving;
  const NodeBox* box = boxes_in(w, step);
  const NodeBox* const end = box + moving.count;
  const int32_t warp = w.block.thread() / warp_width * w.blocks + w.member;
  for (int32_t entry = warp * warp_width + w.lane();; entry += w.blocks * w.block.threads()) {
    while (box != end && entry >= box->first + box->count()) ++box;
    if (box == end) return;
    const Vec<int, 3> node = box->low + node_of_entry(entry - box->first, box->size);
    scene.contact[step % 2][entry] = find_moving_contact(w, moving, node);
  }
}

/// Whether moving obstacles may hold nodes of the stencil of a base node, in the present substep.
template <typename W>
GRAUPEL_HD inline bool meets_moving(const W& w, const Vec<int, 3>& base) {
  const NodeBox* box = boxes_in(w, w.step);
  for (const NodeBox* const end = box + w.shared.changing.moving.count; box != end; ++box) {
    bool meets = true;
    for (int d = 0; d < 3; ++d) meets = meets && base[d] + 2 >= box->low[d] && base[d] < box->low[d] + box->size[d];
    if (meets) return true;
  }
  return false;
}

/// What holds a node in the present substep. `near`: moving obstacles may.
template <typename W>
GRAUPEL_HD inline NodeContact contact_of(const W& w, const Vec<int, 3>& node, int32_t place, bool near) {
  if constexpr (W::View::changes) {
    const ChangingScene& scene = w.shared.changing;
    const NodeBox* box = boxes_in(w, w.step);
    for (const NodeBox* const end = box + (near ? scene.moving.count : 0); box != end; ++box) {
      const Vec<int, 3> at = node - box->low;
      bool inside = true;
      for (int d = 0; d < 3; ++d) inside = inside && at[d] >= 0 && at[d] < box->size[d];
      const int32_t entry = box->first + (at[0] * box->size[1] + at[1]) * box->size[2] + at[2];
      if (inside) return w.block.fresh(scene.contact[w.step % 2] + entry);
    }
  }
  return w.small.contact[place];
}

/// Velocity of a node after contact, from that before [m/s]. Relative to a moving obstacle that holds it; deep inside
/// the material moves with it.
template <typename W>
GRAUPEL_HD inline Vec<float, 3> apply_contact_of(const W& w, const Vec<int, 3>& node, NodeContact contact,
                                                 const Vec<float, 3>& v) {
  if (contact.code == 0) return v;
  if constexpr (W::View::changes) {
    const int32_t law = (contact.code & 0xffff) - 1;
    Vec<float, 3> u = Vec<float, 3>::zero(), after = u;
    const bool moves = (contact.code & held_by_moving) != 0;
    if (moves) {
      const RigidStep<float>& motion = moving_now(w).step[law];
      u = motion.velocity_at(w.scene.view.grid.node_position(node));
    }
    if (!moves || norm2(contact.normal) > 0.0f) after = apply_law(w.small, law, contact.normal, v - u);
    contact.code &= ~held_by_moving;
    return apply_further_walls(w.small, contact, u + after);
  } else {
    return apply_contact_at_node(w.small, contact, v);
  }
}

template <typename W>
GRAUPEL_HD inline Presence& presence_of(const W& w, int64_t slot) {
  return w.shared.changing.lifecycle.presence[slot - w.small.first];
}

/// Whether a particle is in the run.
template <typename W>
GRAUPEL_HD inline bool is_present(const W& w, int64_t slot) {
  if constexpr (W::View::changes)
    return w.shared.changing.lifecycle.presence == nullptr || presence_of(w, slot) == Presence::active;
  return true;
}

/// Whether a particle that is not in the run appears in the present substep; then x is where its motion begins.
template <typename W>
GRAUPEL_HD inline bool is_born(const W& w, int64_t slot, const Vec<float, 3>& v, Vec<float, 3>& x) {
  const ChangingScene& scene = w.shared.changing;
  return presence_of(w, slot) == Presence::unborn &&
         appears(scene.step_end[w.step], scene.lifecycle.birth_time[slot - w.small.first], w.dt, v, x);
}

/// The motion that leads a particle in a substep of the frame, or null.
template <typename W>
GRAUPEL_HD inline const RigidStep<float>* leader_of(const W& w, int64_t slot, int32_t step) {
  if constexpr (W::View::changes) {
    const ChangingScene& scene = w.shared.changing;
    if (scene.lifecycle.script == nullptr || step >= scene.substeps) return nullptr;
    const int32_t script = scene.lifecycle.script[slot - w.small.first];
    if (script < 0) return nullptr;
    const ScriptStep<float>& of_step = scene.scripts[int64_t(step) * scene.script_count + script];
    return of_step.leads ? &of_step.motion : nullptr;
  }
  return nullptr;
}

/// A led particle takes its leader's velocity; what that gives it counts where `reports`.
template <typename W>
GRAUPEL_HD inline void follow(const W& w, const RigidStep<float>& leader, const Vec<float, 3>& x, float mass,
                              bool reports, Vec<float, 3>& v) {
  const Vec<float, 3> led = leader.velocity_at(x), change = led - v;
  v = led;
  if (!reports) return;
  for (int d = 0; d < 3; ++d) {
    batch::FixedMomentum given;
    given += static_cast<double>(mass * change[d]);
    w.block.add(&w.shared.report.scripted_momentum[d], static_cast<unsigned long long>(given.units));
  }
}

/// What of the affine velocity is carried on.
template <typename W>
GRAUPEL_HD inline Mat<float, 3> carried_on(const W& w, const Mat<float, 3>& C) {
  if constexpr (W::View::changes) return w.shared.changing.carried(C);
  return C;
}

/// Moves a particle as move_point(); whether it left the run. It then speaks of its push-out alone.
template <typename W>
[[gnu::always_inline]] GRAUPEL_HD inline bool move_and_leave(const W& w, bool led, int32_t place, float mass,
                                                             Vec<float, 3>& x, Vec<float, 3>& v,
                                                             batch::ParticleFindings& found) {
  const SceneView<float>& scene = w.scene.view;
  const ChangingScene& changing = w.shared.changing;
  const LifecycleView<float>& lifecycle = changing.lifecycle;
  const MovingObstacleView<float>& moving = moving_now(w);
  if (!move_point<true, 3>(scene, moving, led, place, mass, w.dt, x, v, found)) return false;
  if (led || !has_exits(scene.walls, lifecycle) || !leaves(scene.walls, lifecycle, scene.grid.dx, x)) return false;
  found.largest_sound_speed = 0;
  found.over_courant = 0;
  found.bad_slot = -1;
  return true;
}

}  // namespace graupel::mpm::small
