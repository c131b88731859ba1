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

#include "core/parallel/thread_block.h"
#include "mpm/gpu/blocks/batch_report.h"
#include "mpm/gpu/small/small_scene_contact.h"
#include "mpm/physics/particle_motion.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm::small {

inline constexpr int threads = 256;
inline constexpr int warps = threads / warp_width;
inline constexpr int particle_lanes = 8;  ///< lanes of a particle
inline constexpr int stencil_nodes = 27;
inline constexpr uint32_t arrival_stop = 1u << 20;  ///< added to the number of arrivals by a block that must stop

/// A particle between reading and adding. Odd lengths, so that lanes with a particle each meet different banks.
struct Moment {
  float value[12];  ///< sum of w v, then of w v (x_i - x_p)^T / dx row by row
  float pad;
};
struct Contribution {
  float fx[3];
  int32_t base;
  float row[4][4];  ///< sum of channel c at node (i, j, k) of the stencil: w (row[c] . (1, i, j, k)), in units
  float pad;
};
union Staged {
  Moment moment;
  Contribution contribution;
};
struct Shared {
  Staged staged[warps][warp_width];
  BatchScene scene;
  SmallScene small;
  int32_t node[stencil_nodes];  ///< place of every node of a stencil, from that of its base node
  StepReport report;
  uint32_t arrivals;
};

/// The part of a block of threads in the frame of one scene.
template <typename Block>
struct Worker {
  const Block& block;
  const SmallBatchView& view;
  Shared& shared;
  const BatchScene& scene;  ///< copies in shared memory
  const SmallScene& small;
  int32_t number;      ///< of the scene
  int32_t blocks;      ///< of the group
  int32_t member;      ///< this block's place among them
  int32_t chunk_size;  ///< particles that a warp takes at once, a multiple of four
  float dt;
  float speed2 = 0, sound_speed = 0;  ///< largest of this thread's particles in a substep
  float before_speed2 = 0, before_sound_speed = 0, peak_sound_speed = 0;

  GRAUPEL_HD int lane() const { return block.thread() % warp_width; }
  GRAUPEL_HD Staged* staged() const { return shared.staged[block.thread() / warp_width]; }

  /// Calls work(first, count) for every chunk of this warp: particles first .. first + count - 1 of the scene.
  template <typename Work>
  GRAUPEL_HD void for_chunks(const Work& work) const {
    const int32_t own_warps = block.threads() / warp_width, stride = blocks * own_warps * chunk_size;
    for (int32_t first = (member * own_warps + block.thread() / warp_width) * chunk_size; first < small.count;
         first += stride)
      work(first, small.count - first < chunk_size ? small.count - first : chunk_size);
  }

  /// Waits for the blocks of the scene, the n-th time (from 1); whether one of them had to stop.
  GRAUPEL_HD bool grid_barrier(int32_t n) const {
    block.sync();
    if (block.thread() == 0) {
      uint32_t* const arrivals = view.arrivals + number;
      block.arrive(arrivals, shared.report.bad_particle != no_bad_particle ? arrival_stop + 1 : 1u);
      const auto all = static_cast<uint32_t>(blocks) * static_cast<uint32_t>(n);
      uint32_t seen = block.fresh(arrivals);
      while (seen % arrival_stop < all) {
        block.pause();
        seen = block.fresh(arrivals);
      }
      shared.arrivals = seen;
      shared.report.over_courant = 0;  // only those of a frame's last substep count
    }
    block.sync();
    return shared.arrivals >= arrival_stop;
  }
};

/// Place of a node in the grid.
GRAUPEL_HD inline int32_t place_of(const SmallScene& small, const Vec<int, 3>& node) {
  return (node[0] * small.nodes[1] + node[1]) * small.nodes[2] + node[2];
}

/// Velocity after gravity (`gain` [m/s]) and contact of a node with these sums; zero without mass.
GRAUPEL_HD inline Vec<float, 3> node_velocity(const SmallScene& small, float momentum_per_mass_unit,
                                              const Vec<float, 3>& gain, const NodeContact& contact,
                                              const UnitPair& low, const UnitPair& high) {
  const float mass = static_cast<float>(high.b);
  const float scale = mass > 0.0f ? momentum_per_mass_unit * fast_reciprocal(mass) : 0.0f;
  const Vec<float, 3> v = free_velocity(
      Vec<float, 3>{static_cast<float>(low.a), static_cast<float>(low.b), static_cast<float>(high.a)}, scale, gain);
  return contact.code != 0 ? apply_contact_at_node(small, contact, v) : v;
}

/// Sums of twelve values over the eight lanes of a particle, three of them in every lane: with every step, a lane gives
/// away the half of its values that its partner keeps. Returns the place of its first.
template <typename Block>
GRAUPEL_HD inline int add_lanes(const Block& block, int part, float (&value)[12]) {
  const bool upper = (part & 4) != 0, second = (part & 2) != 0;
  for (int i = 0; i < 6; ++i) {
    const float given = upper ? value[i] : value[i + 6], kept = upper ? value[i + 6] : value[i];
    value[i] = kept + block.shuffle_xor(given, 4);
  }
  for (int i = 0; i < 3; ++i) {
    const float given = second ? value[i] : value[i + 3], kept = second ? value[i + 3] : value[i];
    value[i] = kept + block.shuffle_xor(given, 2);
  }
  for (int i = 0; i < 3; ++i) value[i] += block.shuffle_xor(value[i], 1);
  return (upper ? 6 : 0) + (second ? 3 : 0);
}

/// G2P of a chunk: moments of the particles into the warp's staged ones.
template <typename Block>
GRAUPEL_HD void gather_chunk(const Worker<Block>& w, int32_t first, int32_t count, const UnitPair* sums) {
  const SceneView<float>& scene = w.scene.view;
  const SmallScene& small = w.small;
  const int part = w.lane() % particle_lanes;
  const Vec<float, 3> gain = w.dt * scene.gravity;
  const float per_mass = small.momentum_unit * small.per_mass_unit;
  constexpr int rounds = (stencil_nodes + particle_lanes - 1) / particle_lanes;
  for (int32_t n = 0; n < count; n += warp_width / particle_lanes) {
    const int32_t particle = n + w.lane() / particle_lanes, at = particle < count ? particle : count - 1;
    const Stencil<float, 3> s =
        stencil_at(scene.grid.local(w.view.particles.position.vec(int64_t(small.first) + first + at)));
    const int32_t base = place_of(small, s.base);
    UnitPair low[rounds], high[rounds];
    NodeContact contact[rounds];
    GRAUPEL_UNROLL
    for (int r = 0; r < rounds; ++r) {
      const int node = part + particle_lanes * r < stencil_nodes ? part + particle_lanes * r : 0;
      const int32_t place = base + w.shared.node[node];
      low[r] = w.block.fresh(sums + 2 * int64_t(place));
      high[r] = w.block.fresh(sums + 2 * int64_t(place) + 1);
      contact[r] = small.contact[place];
    }
    float sum[12] = {};
    GRAUPEL_UNROLL
    for (int r = 0; r < rounds; ++r) {
      const int node = part + particle_lanes * r;
      const float offset[3] = {static_cast<float>(node / 9) - s.fx[0], static_cast<float>(node / 3 % 3) - s.fx[1],
                               static_cast<float>(node % 3) - s.fx[2]};
      const float w_node = node < stencil_nodes ? bspline(offset[0]) * bspline(offset[1]) * bspline(offset[2]) : 0.0f;
      const Vec<float, 3> v = w_node * node_velocity(small, per_mass, gain, contact[r], low[r], high[r]);
      for (int c = 0; c < 3; ++c) {
        sum[c] += v[c];
        for (int d = 0; d < 3; ++d) sum[3 + 3 * c + d] += v[c] * offset[d];
      }
    }
    const int place = add_lanes(w.block, part, sum);
    if (part % 2 == 0 && particle < count)
      for (int c = 0; c < 3; ++c) w.staged()[particle].moment.value[place + c] = sum[c];
  }
}

/// What a particle adds to the nodes of its stencil: w (m v + A (x_i - x_p)), with A = m C - dt V0 (4 / dx^2) tau.
/// `A` is given times dx.
GRAUPEL_HD inline Contribution contribution_of(const SceneView<float>& scene, const SmallScene& small,
                                               const Vec<float, 3>& x, const Vec<float, 3>& v, const Mat<float, 3>& A,
                                               float mass) {
  const Stencil<float, 3> s = stencil_at(scene.grid.local(x));
  const Vec<float, 3> q = small.per_momentum_unit * (mass * v - A * s.fx);
  Contribution staged = {};
  staged.base = place_of(small, s.base);
  for (int d = 0; d < 3; ++d) {
    staged.fx[d] = s.fx[d];
    staged.row[d][0] = q[d];
    for (int c = 0; c < 3; ++c) staged.row[d][1 + c] = small.per_momentum_unit * A(d, c);
  }
  staged.row[3][0] = small.per_mass_unit * mass;
  return staged;
}

/// What a particle adds at the start of a frame.
template <typename Block>
GRAUPEL_HD Contribution initial_contribution(const Worker<Block>& w, int64_t slot) {
  const ParticleView<float>& p = w.view.particles;
  const SceneView<float>& scene = w.scene.view;
  const float volume = p.volume.get(slot), mass = scene.materials[p.material.get(slot)].density * volume;
  const Mat<float, 3> A =
      affine_momentum(mass, volume, w.dt, scene.grid.dx, scene.grid.inverse_dx,
                      load_matrix<float, 3>(p.affine_velocity, slot), load_symmetric(p.stress, slot));
  return contribution_of(scene, w.small, p.position.vec(slot), p.velocity.vec(slot), A, mass);
}

enum class Keep { motion, everything };  ///< what of a particle's new state is stored

/// A particle from its moments to its new state and what it adds to the next grid. `reports`: this lane speaks for it.
template <typename Block>
GRAUPEL_HD Contribution advance(Worker<Block>& w, int64_t slot, const Moment& moment, bool reports, Keep keep) {
  const ParticleView<float>& p = w.view.particles;
  const SceneView<float>& scene = w.scene.view;
  const MaterialParameters<float>& m = scene.materials[p.material.get(slot)];
  const int32_t place = p.source_index.get(slot);
  const float dx = scene.grid.dx, volume = p.volume.get(slot), mass = m.density * volume;
  batch::ParticleFindings found;
  Vec<float, 3> x = p.position.vec(slot), v;
  float internal = p.internal.get(slot);
  Mat<float, 3> F = Mat<float, 3>::identity(), A = Mat<float, 3>::zero();
  if (m.model == MaterialModel::stationary) {  // keeps place and velocity whatever the grid does
    v = p.velocity.vec(slot);
    state_statistics(dx, m, place, v, F, internal, w.dt, found);
  } else {
    Mat<float, 3> C;
    for (int r = 0; r < 3; ++r) {
      v[r] = moment.value[r];
      for (int c = 0; c < 3; ++c) C(r, c) = 4.0f * scene.grid.inverse_dx * moment.value[3 + 3 * r + c];
    }
    if (keeps_deformation(m.model)) F = load_matrix<float, 3>(p.deformation_gradient, slot);
    const Mat<float, 3> tau = update_material(m, w.dt, C, F, internal);
    A = affine_momentum(mass, volume, w.dt, dx, scene.grid.inverse_dx, C, tau);
    if (reports) {
      if (keeps_deformation(m.model)) store_matrix<float, 3>(p.deformation_gradient, slot, F);
      p.internal.set(slot, internal);
      if (keep == Keep::everything) {
        store_matrix<float, 3>(p.affine_velocity, slot, C);
        store_symmetric(p.stress, slot, tau);
      }
    }
    if (!deformation_statistics(dx, m, F, internal, w.dt, found)) mark_bad(place, found);
    move_point<false, 3>(scene, {}, false, place, mass, w.dt, x, v, found);
    if (reports) {
      p.position.set_vec(slot, x);
      p.velocity.set_vec(slot, v);
    }
    if (!velocity_statistics(v, found)) mark_bad(place, found);
  }
  if (reports) {
    w.speed2 = found.largest_speed2 > w.speed2 ? found.largest_speed2 : w.speed2;
    w.sound_speed = found.largest_sound_speed > w.sound_speed ? found.largest_sound_speed : w.sound_speed;
    if (found.over_courant || found.bad_slot >= 0 || found.pushed_out)
      batch::report_rare(w.block, found, true, w.shared.report);
  }
  return contribution_of(scene, w.small, x, v, A, mass);
}

/// P2G of a chunk: adds the staged particles to a grid. Four lanes stand for the four sums of a node, and twice four
/// share a particle: the others see the stencil from its far corner, with mirrored weights, and stop before the node in
/// its middle.
template <typename Block>
GRAUPEL_HD void scatter_chunk(const Worker<Block>& w, int32_t count, UnitPair* sums) {
  const int channel = w.lane() % 4;
  const bool mirrored = w.lane() / 4 % 2 == 1;
  const int32_t row = 4 * w.small.nodes[2], plane = row * w.small.nodes[1];
  const int32_t step[3] = {mirrored ? -plane : plane, mirrored ? -row : row, mirrored ? -4 : 4};
  const int32_t corner = channel + (mirrored ? 2 * (plane + row + 4) : 0);
  auto* const units = reinterpret_cast<long long*>(sums);
  for (int32_t n = 0; n < count; n += warp_width / particle_lanes) {
    const int32_t particle = n + w.lane() / particle_lanes;
    if (particle >= count) continue;
    const Contribution& s = w.staged()[particle].contribution;
    AxisWeights<float> weight[3];
    for (int d = 0; d < 3; ++d) weight[d] = bspline_weights(mirrored ? 2.0f - s.fx[d] : s.fx[d]);
    float at_corner = s.row[channel][0], slope[3] = {s.row[channel][1], s.row[channel][2], s.row[channel][3]};
    if (mirrored) {
      at_corner += 2.0f * (slope[0] + slope[1] + slope[2]);
      for (float& change : slope) change = -change;
    }
    long long* const at = units + 4 * int64_t(s.base) + corner;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 3; ++j) {
        long long* const at_row = at + i * step[0] + j * step[1];
        const float w_row = weight[0].w[i] * weight[1].w[j];
        const float value = at_corner + static_cast<float>(i) * slope[0] + static_cast<float>(j) * slope[1];
        for (int k = 0; k < 3; ++k) {
          const int node = 9 * i + 3 * j + k;
          if (node > stencil_nodes / 2 || (node == stencil_nodes / 2 && mirrored)) continue;
          w.block.add_units(at_row + k * step[2], w.block.nearest_integer(w_row * weight[2].w[k] *
                                                                          (value + static_cast<float>(k) * slope[2])));
        }
      }
  }
}

/// Clears the nodes that the particles of a chunk last added to in a grid.
template <typename Block>
GRAUPEL_HD void clear_chunk(const Worker<Block>& w, int32_t first, int32_t count, const int32_t* bases,
                            UnitPair* sums) {
  const int part = w.lane() % particle_lanes;
  for (int32_t n = 0; n < count; n += warp_width / particle_lanes) {
    const int32_t particle = n + w.lane() / particle_lanes;
    if (particle >= count) continue;
    const int32_t base = bases[w.small.first + first + particle];
    if (base < 0) continue;
    GRAUPEL_UNROLL
    for (int half = part; half < 2 * stencil_nodes; half += particle_lanes)
      sums[2 * int64_t(base + w.shared.node[half / 2]) + half % 2] = {0, 0};
  }
}

/// Stages what the lanes' particles add, and remembers where.
template <typename Block>
GRAUPEL_HD void stage(const Worker<Block>& w, int32_t first, int32_t count, const Contribution& contribution,
                      int32_t* bases) {
  const int lane = w.lane();
  if (lane < count) {
    w.staged()[lane].contribution = contribution;
    bases[w.small.first + first + lane] = contribution.base;
  }
  w.block.sync_warp();
}

/// The speeds of a substep become those of the substep before.
template <typename Block>
GRAUPEL_HD void begin_substep(Worker<Block>& w) {
  w.before_speed2 = w.speed2;
  w.before_sound_speed = w.sound_speed;
  w.peak_sound_speed = w.sound_speed > w.peak_sound_speed ? w.sound_speed : w.peak_sound_speed;
  w.speed2 = 0;
  w.sound_speed = 0;
}

/// One substep of a warp's chunks: from grid k to grid k + 1, while grid k + 2 is cleared (all modulo 3).
template <typename Block>
GRAUPEL_HD void substep(Worker<Block>& w, int64_t k, bool last) {
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
template <typename Block>
GRAUPEL_HD void scatter_scene(const Worker<Block>& w, int64_t k) {
  w.for_chunks([&](int32_t first, int32_t count) {
    const int own = w.lane() % w.chunk_size, at = own < count ? own : count - 1;
    stage(w, first, count, initial_contribution(w, int64_t(w.small.first) + first + at),
          w.view.base + k % 3 * w.view.particles.count);
    scatter_chunk(w, count, w.small.sums[k % 3]);
    w.block.sync_warp();
  });
}

/// A frame of one scene by the blocks of a group.
template <typename Block>
GRAUPEL_HD void run_scene(Worker<Block>& w) {
  const SceneProgress& control = w.view.controls[w.number];
  const int64_t k = control.substeps;
  const int32_t substeps = control.equal_substeps;
  scatter_scene(w, k);
  bool stop = w.grid_barrier(1);
  int32_t done = 0;
  while (!stop && done < substeps) {
    begin_substep(w);
    substep(w, k + done, done + 1 == substeps);
    ++done;
    if (done < substeps) stop = w.grid_barrier(1 + done);
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

template <typename Block>
GRAUPEL_HD void load_scene(const Block& block, const SmallBatchView& view, int32_t scene, Shared& shared) {
  if (block.thread() == 0) {
    shared.scene = view.scenes[scene];
    shared.small = view.small[scene];
    clear_report(shared.report);
  }
  for (int node = block.thread(); node < stencil_nodes; node += block.threads()) {
    const Vec<int, 3>& nodes = view.small[scene].nodes;
    shared.node[node] = (node / 9 * nodes[1] + node / 3 % 3) * nodes[2] + node % 3;
  }
  block.sync();
}

/// A frame of every scene that waits for one.
template <typename Block>
GRAUPEL_HD void run_frame(const Block& block, const SmallBatchView& view, Shared& shared) {
  const int32_t blocks = block.blocks() / view.groups, group = block.index() / blocks;
  if (group >= view.groups) return;
  for (int32_t scene = group; scene < view.scene_count; scene += view.groups) {
    if (view.controls[scene].phase != ScenePhase::unsorted) continue;
    load_scene(block, view, scene, shared);
    Worker<Block> w{block,
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

/// Prepares a scene for its next frame.
struct BeginFrame {
  SmallBatchView view;
  int32_t blocks;  ///< of a group
  GRAUPEL_HD void operator()(int64_t scene) const {
    view.arrivals[scene] = 0;
    begin_frame(view.scenes[scene], view.controls[scene]);
    view.controls[scene].blocks = blocks;
  }
};

}  // namespace graupel::mpm::small
