// A frame of small scenes in one kernel, by particles instead of blocks: no lists, no sorting, and one barrier among
// the threads of a scene in a substep. A particle reads the sums at its 27 nodes, makes them velocities there and then
// (gravity, contact), moves, and adds its contribution to the next grid by integer atomics. Where particles are spread
// thin, this is less work than the blocks around them. Equals the phases of mpm/phases/. Gain over mpm/gpu/blocks/,
// H200, recipe scenes: one scene 2.22 -> 0.68 ms a frame, 64 scenes 0.40 -> 0.84 G particle-updates a second
// (docs/decisions/0007-small-scenes-on-gpus.md, docs/lab/gpu-mpm.md).
//
// Eight lanes of a warp share a particle while it reads or adds; in between, every lane has a particle of its own (or
// several lanes the same one, when there are more lanes than particles). The eight partial sums are added in a fixed
// order, so the number of particles that a warp takes at once does not change a bit.
#pragma once

#include "mpm/gpu/small/small_scene_transfer.h"

namespace graupel::mpm::small {

/// affine_momentum() with a particle's stored stress.
template <typename W>
GRAUPEL_HD Mat<float, 3> affine_momentum_of(const W& w, float mass, float volume, const Mat<float, 3>& C,
                                            int64_t slot) {
  const GridGeometry<float, 3>& grid = w.scene.view.grid;
  return affine_momentum(mass, volume, w.dt, grid.dx, grid.inverse_dx, C,
                         load_symmetric(w.view.particles.stress, slot));
}
/// affine_momentum() of a particle's stored state.
template <typename W>
GRAUPEL_HD Mat<float, 3> stored_affine_momentum(const W& w, int64_t slot, float mass, float volume) {
  return affine_momentum_of(w, mass, volume, load_matrix<float, 3>(w.view.particles.affine_velocity, slot), slot);
}

/// What a particle adds at the start of a frame. `reports`: this lane speaks for it.
template <typename W>
GRAUPEL_HD Contribution initial_contribution(const W& w, int64_t slot, bool reports) {
  if (!is_present(w, slot)) return no_contribution();
  const ParticleView<float>& p = w.view.particles;
  const SceneView<float>& scene = w.scene.view;
  const float volume = p.volume.get(slot), mass = scene.materials[p.material.get(slot)].density * volume;
  const Vec<float, 3> x = p.position.vec(slot);
  if (const RigidStep<float>* const leader = leader_of(w, slot, 0)) {
    Vec<float, 3> v = p.velocity.vec(slot);
    follow(w, *leader, x, mass, reports, v);
    return contribution_of(scene, w.small, x, v, affine_momentum_of(w, mass, volume, leader->gradient, slot), mass);
  }
  const Mat<float, 3> A = stored_affine_momentum(w, slot, mass, volume);
  return contribution_of(scene, w.small, x, p.velocity.vec(slot), A, mass);
}

enum class Keep { motion, everything };  ///< what of a particle's new state is stored

/// A particle from its moments to its new state and what it adds to the next grid. One that is born in the substep has
/// no moments: it moves with its own velocity. `reports`: this lane speaks for it.
template <typename W>
GRAUPEL_HD Contribution advance(W& w, int64_t slot, const Moment& moment, bool reports, Keep keep) {
  const ParticleView<float>& p = w.view.particles;
  const SceneView<float>& scene = w.scene.view;
  const MaterialParameters<float>& m = scene.materials[p.material.get(slot)];
  const int32_t place = p.source_index.get(slot);
  const float dx = scene.grid.dx, volume = p.volume.get(slot), mass = m.density * volume;
  batch::ParticleFindings found;
  Vec<float, 3> x = p.position.vec(slot), v;
  float internal = p.internal.get(slot);
  Mat<float, 3> F = Mat<float, 3>::identity(), A = Mat<float, 3>::zero(), tau = A;
  const RigidStep<float>* const leader = leader_of(w, slot, w.step);
  bool born = false, left = false;
  if constexpr (W::View::changes)
    if (!is_present(w, slot)) {
      born = is_born(w, slot, p.velocity.vec(slot), x);
      if (!born) return no_contribution();
    }
  if (m.model == MaterialModel::stationary && leader == nullptr) {  // keeps place and velocity whatever the grid does
    v = p.velocity.vec(slot);
    state_statistics(dx, m, place, v, F, internal, w.dt, found);
    if (born && reports) p.position.set_vec(slot, x);
  } else {
    if (born) {
      v = p.velocity.vec(slot);
      if (keeps_deformation(m.model)) F = load_matrix<float, 3>(p.deformation_gradient, slot);
      A = stored_affine_momentum(w, slot, mass, volume);
    } else {
      Mat<float, 3> C;
      for (int r = 0; r < 3; ++r) {
        v[r] = moment.value[r];
        for (int c = 0; c < 3; ++c) C(r, c) = 4.0f * scene.grid.inverse_dx * moment.value[3 + 3 * r + c];
      }
      if (leader != nullptr) {
        follow(w, *leader, x, mass, reports, v);
        C = leader->gradient;
      }
      if (keeps_deformation(m.model)) F = load_matrix<float, 3>(p.deformation_gradient, slot);
      tau = update_material(m, w.dt, C, F, internal);
      C = carried_on(w, C);
      A = affine_momentum(mass, volume, w.dt, dx, scene.grid.inverse_dx, C, tau);
      if (reports) {
        if (keeps_deformation(m.model)) store_matrix<float, 3>(p.deformation_gradient, slot, F);
        p.internal.set(slot, internal);
        if (keep == Keep::everything) {
          store_matrix<float, 3>(p.affine_velocity, slot, C);
          store_symmetric(p.stress, slot, tau);
        }
      }
    }
    if (!deformation_statistics(dx, m, F, internal, w.dt, found)) mark_bad(place, found);
    if constexpr (W::View::changes)
      left = move_and_leave(w, leader != nullptr, place, mass, x, v, found);
    else
      move_point<false, 3>(scene, {}, false, place, mass, w.dt, x, v, found);
    if (left) v = Vec<float, 3>::zero();
    if (reports) {
      p.position.set_vec(slot, x);
      p.velocity.set_vec(slot, v);
      if (left) store_matrix<float, 3>(p.affine_velocity, slot, Mat<float, 3>::zero());
    }
    if (!velocity_statistics(v, found)) mark_bad(place, found);
  }
  if (reports) {
    w.speed2 = found.largest_speed2 > w.speed2 ? found.largest_speed2 : w.speed2;
    w.sound_speed = found.largest_sound_speed > w.sound_speed ? found.largest_sound_speed : w.sound_speed;
    if (found.over_courant || found.bad_slot >= 0 || found.pushed_out)
      batch::report_rare(w.block, found, true, w.shared.report);
    if constexpr (W::View::changes)
      if (born || left) presence_of(w, slot) = left ? Presence::gone : Presence::active;
  }
  if (left) return no_contribution();
  if (const RigidStep<float>* const next = leader_of(w, slot, w.step + 1)) {
    follow(w, *next, x, mass, reports, v);
    A = affine_momentum(mass, volume, w.dt, dx, scene.grid.inverse_dx, next->gradient, tau);
  }
  return contribution_of(scene, w.small, x, v, A, mass);
}

/// The speeds of a substep become those of the substep before.
template <typename W>
GRAUPEL_HD void begin_substep(W& w) {
  w.before_speed2 = w.speed2;
  w.before_sound_speed = w.sound_speed;
  w.peak_sound_speed = w.sound_speed > w.peak_sound_speed ? w.sound_speed : w.peak_sound_speed;
  w.speed2 = 0;
  w.sound_speed = 0;
}

/// One substep of a warp's chunks: from grid k to grid k + 1, while grid k + 2 is cleared (all modulo 3).
template <typename W>
GRAUPEL_HD void substep(W& w, int64_t k, bool last) {
  const auto bases = [&](int64_t grid) { return w.view.base + grid % 3 * w.view.particles.count; };
  UnitPair *const current = w.small.sums[k % 3], *const next = w.small.sums[(k + 1) % 3],
                  *const old = w.small.sums[(k + 2) % 3];
  w.for_chunks([&](int32_t first, int32_t count) {
    clear_chunk(w, first, count, bases(k + 2), old);
    gather_chunk(w, first, count, current);
    w.block.sync_warp();
    const int lane = w.lane(), own = lane % w.chunk_size, at = own < count ? own : count - 1;
    const Moment moment = w.staged()[at].moment;
    w.block.sync_warp();
    const Contribution contribution =
        advance(w, int64_t(w.small.first) + first + at, moment, lane < count, last ? Keep::everything : Keep::motion);
    if (last) return;
    stage(w, first, count, contribution, bases(k + 1));
    scatter_chunk(w, count, next);
    w.block.sync_warp();
  });
}

/// P2G of the present state into grid k (modulo 3).
template <typename W>
GRAUPEL_HD void scatter_scene(const W& w, int64_t k) {
  w.for_chunks([&](int32_t first, int32_t count) {
    const int own = w.lane() % w.chunk_size, at = own < count ? own : count - 1;
    stage(w, first, count, initial_contribution(w, int64_t(w.small.first) + first + at, w.lane() < count),
          w.view.base + k % 3 * w.view.particles.count);
    scatter_chunk(w, count, w.small.sums[k % 3]);
    w.block.sync_warp();
  });
}

/// Waits for the blocks of the scene before a substep; whether one of them had to stop.
template <typename W>
GRAUPEL_HD inline bool begin_step(const W& w, int32_t step) {
  if constexpr (W::View::changes) begin_changes(w, step);
  return w.grid_barrier(1 + step);
}

/// A frame of one scene by the blocks of a group.
template <typename W>
GRAUPEL_HD void run_scene(W& w) {
  const SceneProgress& control = w.view.controls[w.number];
  const int64_t k = control.substeps;
  const int32_t substeps = control.equal_substeps;
  scatter_scene(w, k);
  bool stop = begin_step(w, 0);
  int32_t done = 0;
  while (!stop && done < substeps) {
    begin_substep(w);
    w.step = done;
    substep(w, k + done, done + 1 == substeps);
    ++done;
    if (done < substeps) stop = begin_step(w, done);
  }
  w.block.max(&w.shared.report.speed2, batch::bits_of(w.speed2));
  w.block.max(&w.shared.report.sound_speed, batch::bits_of(w.sound_speed));
  w.block.max(&w.shared.report.before_speed2, batch::bits_of(w.before_speed2));
  w.block.max(&w.shared.report.before_sound_speed, batch::bits_of(w.before_sound_speed));
  w.block.max(&w.shared.report.peak_sound_speed, batch::bits_of(w.peak_sound_speed));
  w.block.sync();
  if (w.block.thread() == 0) batch::report_block(w.block, w.view, w.number, w.shared.report, done);
  w.block.sync();
}

/// Size of chunks of equal length: as few as `all_warps` of them at once allow, in steps of four particles.
GRAUPEL_HD inline int32_t chunk_size_for(int32_t count, int32_t all_warps) {
  constexpr int32_t step = warp_width / particle_lanes;
  const int32_t rounds = (count + all_warps * warp_width - 1) / (all_warps * warp_width),
                chunks = rounds * all_warps * step;
  return (count + chunks - 1) / chunks * step;
}

template <typename Block, typename View>
GRAUPEL_HD void load_scene(const Block& block, const View& view, int32_t scene, SharedFor<View>& shared) {
  if (block.thread() == 0) {
    shared.scene = view.scenes[scene];
    shared.small = view.small[scene];
    if constexpr (View::changes) shared.changing = view.changing[scene];
    clear_report(shared.report);
  }
  for (int node = block.thread(); node < stencil_nodes; node += block.threads()) {
    const Vec<int, 3>& nodes = view.small[scene].nodes;
    shared.node[node] = (node / 9 * nodes[1] + node / 3 % 3) * nodes[2] + node % 3;
  }
  block.sync();
}

/// A frame of every scene that waits for one.
template <typename Block, typename View>
GRAUPEL_HD void run_frame(const Block& block, const View& view, SharedFor<View>& shared) {
  const int32_t blocks = block.blocks() / view.groups, group = block.index() / blocks;
  if (group >= view.groups) return;
  for (int32_t scene = group; scene < view.scene_count; scene += view.groups) {
    if (view.controls[scene].phase != ScenePhase::unsorted) continue;
    load_scene(block, view, scene, shared);
    Worker<Block, View> w{block,
                          view,
                          shared,
                          shared.scene,
                          shared.small,
                          scene,
                          blocks,
                          block.index() % blocks,
                          chunk_size_for(shared.small.count, blocks * (block.threads() / warp_width)),
                          view.controls[scene].dt};
    run_scene(w);
  }
}

/// Prepares a scene for its next frame. That of a changing scene has the substeps for which its tables were made.
template <typename View>
struct BeginFrame {
  View view;
  int32_t blocks;  ///< of a group
  GRAUPEL_HD void operator()(int64_t scene) const {
    view.arrivals[scene] = 0;
    if constexpr (View::changes)
      begin_frame(view.scenes[scene], view.changing[scene].substeps, view.controls[scene]);
    else
      begin_frame(view.scenes[scene], view.controls[scene]);
    view.controls[scene].blocks = blocks;
  }
};

}  // namespace graupel::mpm::small
