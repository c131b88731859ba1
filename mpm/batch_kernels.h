// The three kernels of a substep on a GPU, one block of threads for one block of the grid.
//
// particle_to_grid: a warp's lanes are the 27 nodes of a stencil; the lanes walk together through the particles of a
// cell, each summing its own node in registers, so that neither atomics nor a reduction are needed. Sums of cells are
// added to the warp's arena in shared memory, the warps' arenas to the block's.
// update_grid: every node adds the eight arenas that reach it, then gravity and contact.
// grid_to_particle: a thread a particle: velocity, deformation, stress, new position.
#pragma once

#include "core/thread_block.h"
#include "mpm/batch_view.h"
#include "mpm/node_update.h"
#include "mpm/particle_motion.h"
#include "mpm/step_control.h"

namespace graupel::mpm::batch {

inline constexpr int block_threads = 128;
inline constexpr int block_warps = block_threads / warp_width;

struct HomeBlock {
  int32_t key;  ///< directory index in its scene
  int32_t scene;
  Vec<int, 3> at;  ///< block coordinates
};

GRAUPEL_HD inline HomeBlock home_block(const BatchView& view, int32_t full_key) {
  HomeBlock b;
  b.scene = full_key / view.directory;
  b.key = full_key - b.scene * view.directory;
  b.at = view.scenes[b.scene].view.grid.block_of(b.key);
  return b;
}

/// Key of the block at `at` + (x, y, z), or -1 outside the directory.
GRAUPEL_HD inline int32_t neighbor_key(const BatchView& view, const HomeBlock& b, int x, int y, int z) {
  const GridGeometry<float, 3>& grid = view.scenes[b.scene].view.grid;
  const Vec<int, 3> at = {b.at[0] + x, b.at[1] + y, b.at[2] + z};
  for (int d = 0; d < 3; ++d)
    if (at[d] < 0 || at[d] >= grid.blocks[d]) return -1;
  return b.scene * view.directory + grid.directory_index(at);
}

/// Base node of a particle in its block's arena, 0..5, and its distance from it in cells.
struct ReachPlace {
  Vec<int, 3> base;
  Vec<float, 3> fx;
  bool inside;  ///< false: the particle has left the arena (base is then clamped)
};
GRAUPEL_HD inline ReachPlace reach_place(const GridGeometry<float, 3>& grid, const Vec<int, 3>& block,
                                         const Vec<float, 3>& x) {
  ReachPlace place;
  place.inside = true;
  const Vec<float, 3> local = grid.local(x);
  const Vec<int, 3> base = base_node(local);
  for (int d = 0; d < 3; ++d) {
    int c = base[d] - block_width * block[d] + 1;
    if (c < 0 || c > 5) {
      place.inside = false;
      c = c < 0 ? 0 : 5;
    }
    place.base[d] = c;
    place.fx[d] = local[d] - static_cast<float>(block_width * block[d] + c - 1);
  }
  return place;
}

/// A particle as the lanes of a warp read it: its sums at node (i, j, k) of its stencil are w (q + A (i, j, k)), w m.
struct alignas(16) StagedParticle {
  float fx[3], mass;
  float q[3];
  int32_t base;  ///< arena index before the turn of rows: x * 64 + y * 8 + z
  float A[3][4];
};

struct ScatterShared {
  NodeSum arena[block_warps][reach_nodes];
  StagedParticle staged[block_warps][warp_width];
};

/// Weight of node i of an axis as a polynomial c0 + c1 f + c2 f^2 of the particle's distance f from the base.
struct LaneWeight {
  float c0, c1, c2;
};
GRAUPEL_HD inline LaneWeight lane_weight(int i) {
  if (i == 0) return {1.125f, -1.5f, 0.5f};
  if (i == 1) return {-0.25f, 2.0f, -1.0f};
  return {0.125f, -0.5f, 0.5f};
}
GRAUPEL_HD inline float weight_at(const LaneWeight& w, float f) { return w.c0 + f * (w.c1 + f * w.c2); }

GRAUPEL_HD inline StagedParticle stage_particle(const BatchView& view, const SceneView<float>& scene,
                                                const Vec<int, 3>& block, int64_t slot, float dt) {
  const ParticleView<float>& p = view.now();
  const ReachPlace place = reach_place(scene.grid, block, p.position.vec(slot));
  const float volume = p.volume.get(slot);
  const float mass = scene.materials[p.material.get(slot)].density * volume;
  const float force = -dt * volume * 4.0f * scene.grid.inverse_dx;
  const Mat<float, 3> A =
      (mass * scene.grid.dx) * load_matrix<float, 3>(p.affine_velocity, slot) + force * load_symmetric(p.stress, slot);
  const Vec<float, 3> q = mass * p.velocity.vec(slot) - A * place.fx;
  StagedParticle s;
  s.mass = mass;
  s.base = (place.base[0] * reach_width + place.base[1]) * reach_width + place.base[2];
  for (int r = 0; r < 3; ++r) {
    s.fx[r] = place.fx[r];
    s.q[r] = q[r];
    for (int c = 0; c < 3; ++c) s.A[r][c] = A(r, c);
    s.A[r][3] = 0;
  }
  return s;
}

template <typename Block>
GRAUPEL_HD void particle_to_grid(const Block& block, const BatchView& view, ScatterShared& shared) {
  const int home = block.index();
  if (home >= view.counts->homes_to_run()) return;
  const HomeBlock b = home_block(view, view.home_key[home]);
  const StepControl& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  const SceneView<float>& scene = view.scenes[b.scene].view;
  const float dt = control.dt;
  const int warp = block.thread() / warp_width, lane = block.thread() % warp_width;
  NodeSum* arena = shared.arena[warp];
  for (int i = lane; i < reach_nodes; i += warp_width) arena[i] = {};
  const int i = lane / 9, j = lane / 3 % 3, k = lane % 3;
  const LaneWeight wx = lane_weight(i), wy = lane_weight(j), wz = lane_weight(k);
  const float fi = static_cast<float>(i), fj = static_cast<float>(j), fk = static_cast<float>(k);
  const auto flush = [&](int32_t base, const NodeSum& sum) {
    block.sync_warp();
    if (lane >= 27) return;
    NodeSum& node = arena[reach_index(base / 64 + i, base / 8 % 8 + j, base % 8 + k)];
    NodeSum total = node;
    for (int c = 0; c < 4; ++c) total.v[c] += sum.v[c];
    node = total;
  };
  const int32_t begin = view.start[home], end = view.start[home + 1];
  for (int32_t first = begin + warp_width * warp; first < end; first += block_threads) {
    const int32_t count = end - first < warp_width ? end - first : warp_width;
    block.sync_warp();
    if (lane < count) shared.staged[warp][lane] = stage_particle(view, scene, b.at, first + lane, dt);
    block.sync_warp();
    NodeSum sum = {};
    int32_t open = shared.staged[warp][0].base;
    for (int32_t n = 0; n < count; ++n) {
      const StagedParticle s = shared.staged[warp][n];
      if (s.base != open) {
        flush(open, sum);
        sum = {};
        open = s.base;
      }
      const float w = weight_at(wx, s.fx[0]) * weight_at(wy, s.fx[1]) * weight_at(wz, s.fx[2]);
      for (int c = 0; c < 3; ++c) sum.v[c] += w * (s.q[c] + s.A[c][0] * fi + s.A[c][1] * fj + s.A[c][2] * fk);
      sum.v[3] += w * s.mass;
    }
    flush(open, sum);
  }
  block.sync();
  for (int n = block.thread(); n < reach_nodes; n += block_threads) {
    NodeSum sum = shared.arena[0][n];
    for (int other = 1; other < block_warps; ++other)
      for (int c = 0; c < 4; ++c) sum.v[c] += shared.arena[other][n].v[c];
    view.arenas[static_cast<int64_t>(home) * reach_nodes + n] = sum;
  }
}

/// One node: no barriers, so any number of them may share a block of threads.
GRAUPEL_HD inline void update_node(const BatchView& view, int64_t entry) {
  const int64_t number = entry / nodes_per_block<3>;
  if (number >= view.counts->nodes_to_run()) return;
  const HomeBlock b = home_block(view, view.node_key[number]);
  const StepControl& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  const int inside = static_cast<int>(entry % nodes_per_block<3>);
  const Vec<int, 3> c = node_in_block<3>(inside);
  // Along each axis a node lies in the arena of its own block, and of the lower one (nodes 0..2) or the upper (node 3).
  int shift[3], place[3];
  for (int d = 0; d < 3; ++d) {
    shift[d] = c[d] == 3 ? 1 : -1;
    place[d] = c[d] == 3 ? 0 : c[d] + 5;
  }
  NodeSum sum = {};
  for (int corner = 0; corner < 8; ++corner) {
    const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    const int32_t key = neighbor_key(view, b, x * shift[0], y * shift[1], z * shift[2]);
    const int32_t home = key < 0 ? -1 : view.home_of_key[key];
    if (home < 0) continue;
    const NodeSum part =
        view.arenas[static_cast<int64_t>(home) * reach_nodes +
                    reach_index(x ? place[0] : c[0] + 1, y ? place[1] : c[1] + 1, z ? place[2] : c[2] + 1)];
    for (int n = 0; n < 4; ++n) sum.v[n] += part.v[n];
  }
  NodeSum result = {};
  if (sum.v[3] > 0) {
    const Vec<float, 3> v = updated_velocity(view.scenes[b.scene].view, b.key, inside,
                                             Vec<float, 3>{sum.v[0], sum.v[1], sum.v[2]}, sum.v[3], control.dt);
    result = {{v[0], v[1], v[2], sum.v[3]}};
  }
  view.nodes[entry] = result;
}

struct GatherShared {
  NodeSum node[reach_nodes];
  int32_t neighbor[27];  ///< node block at (-1..1)^3, or -1
  StepReport report;
};

/// Velocity and affine velocity of a particle from the nodes around it (mpm/transfer.h).
GRAUPEL_HD inline void gather(const NodeSum* node, const ReachPlace& place, float inverse_dx, Vec<float, 3>& v,
                              Mat<float, 3>& C) {
  AxisWeights<float> w[3];
  for (int d = 0; d < 3; ++d) w[d] = bspline_weights(place.fx[d]);
  float sum[3] = {}, along[3][3] = {};  // along[d]: sum of w v (x_i - x_p) along axis d
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      float row[3] = {};
      const float w_row = w[0].w[i] * w[1].w[j];
      for (int k = 0; k < 3; ++k) {
        const NodeSum n = node[reach_index(place.base[0] + i, place.base[1] + j, place.base[2] + k)];
        const float weight = w_row * w[2].w[k], dz = static_cast<float>(k) - place.fx[2];
        for (int c = 0; c < 3; ++c) {
          const float part = weight * n.v[c];
          row[c] += part;
          along[2][c] += dz * part;
        }
      }
      const float dx = static_cast<float>(i) - place.fx[0], dy = static_cast<float>(j) - place.fx[1];
      for (int c = 0; c < 3; ++c) {
        sum[c] += row[c];
        along[0][c] += dx * row[c];
        along[1][c] += dy * row[c];
      }
    }
  for (int c = 0; c < 3; ++c) {
    v[c] = sum[c];
    for (int d = 0; d < 3; ++d) C(c, d) = 4.0f * inverse_dx * along[d][c];
  }
}

GRAUPEL_HD inline uint32_t bits_of(float non_negative) {
  union {
    float number;
    uint32_t bits;
  } u = {non_negative};
  return u.bits;
}
GRAUPEL_HD inline float number_of(uint32_t bits) {
  union {
    uint32_t bits;
    float number;
  } u = {bits};
  return u.number;
}

/// One particle: from the nodes to its new state. Returns whether it still lies in its block's arena.
GRAUPEL_HD inline bool advance_particle(const BatchView& view, const SceneView<float>& scene, const Vec<int, 3>& block,
                                        const NodeSum* node, int64_t slot, float dt, Survey& found) {
  const ParticleView<float>& p = view.now();
  const MaterialParameters<float>& m = scene.materials[p.material.get(slot)];
  const int32_t place = p.source_index.get(slot);
  Vec<float, 3> x = p.position.vec(slot), v;
  float internal = p.internal.get(slot);
  Mat<float, 3> F = Mat<float, 3>::identity();
  if (m.model == MaterialModel::stationary) {  // keeps place and velocity whatever the grid does
    survey_state(scene.grid.dx, m, place, p.velocity.vec(slot), F, internal, dt, found);
    return true;
  }
  Mat<float, 3> C;
  gather(node, reach_place(scene.grid, block, x), scene.grid.inverse_dx, v, C);
  store_matrix<float, 3>(p.affine_velocity, slot, C);
  const bool solid = keeps_deformation(m.model);
  if (solid) F = load_matrix<float, 3>(p.deformation_gradient, slot);
  store_symmetric(p.stress, slot, update_material(m, dt, C, F, internal));
  if (solid) store_matrix<float, 3>(p.deformation_gradient, slot, F);
  p.internal.set(slot, internal);
  move_point(scene, place, m.density * p.volume.get(slot), dt, x, v, found);
  p.position.set_vec(slot, x);
  p.velocity.set_vec(slot, v);
  survey_state(scene.grid.dx, m, place, v, F, internal, dt, found);
  return reach_place(scene.grid, block, x).inside;
}

/// Adds a thread's findings to those of its block.
template <typename Block>
GRAUPEL_HD void report_particle(const Block& block, const Survey& found, bool inside, StepReport& report) {
  block.max(&report.speed2, bits_of(static_cast<float>(found.largest_speed2)));
  block.max(&report.sound_speed, bits_of(static_cast<float>(found.largest_sound_speed)));
  if (!inside) block.add(&report.left_reach, 1);
  if (found.over_courant > 0) block.add(&report.over_courant, static_cast<int32_t>(found.over_courant));
  if (found.bad_slot >= 0) block.min(&report.bad_particle, static_cast<int32_t>(found.bad_slot));
  if (found.pushed_out == 0) return;
  block.add(&report.pushed_out, static_cast<unsigned long long>(found.pushed_out));
  for (int d = 0; d < 3; ++d)
    block.add(&report.pushed_momentum[d],
              static_cast<unsigned long long>(static_cast<long long>(found.pushed_momentum[d] / momentum_unit)));
}

/// Adds a block's report to its scene's; the last block of a scene ends the substep.
template <typename Block>
GRAUPEL_HD void report_block(const Block& block, const BatchView& view, int32_t scene, const StepReport& mine) {
  StepReport& all = view.reports[scene];
  StepControl& control = view.controls[scene];
  block.max(&all.speed2, mine.speed2);
  block.max(&all.sound_speed, mine.sound_speed);
  if (mine.left_reach) block.add(&all.left_reach, mine.left_reach);
  if (mine.over_courant) block.add(&all.over_courant, mine.over_courant);
  if (mine.bad_particle != no_bad_particle) block.min(&all.bad_particle, mine.bad_particle);
  if (mine.pushed_out) {
    block.add(&all.pushed_out, mine.pushed_out);
    for (int d = 0; d < 3; ++d) block.add(&all.pushed_momentum[d], mine.pushed_momentum[d]);
  }
  block.fence();
  if (block.add(&all.blocks_done, 1) != control.blocks - 1) return;
  block.fence();
  StepReport found;
  found.speed2 = block.exchange(&all.speed2, 0u);
  found.sound_speed = block.exchange(&all.sound_speed, 0u);
  found.left_reach = block.exchange(&all.left_reach, 0);
  found.over_courant = block.exchange(&all.over_courant, 0);
  found.bad_particle = block.exchange(&all.bad_particle, no_bad_particle);
  found.pushed_out = block.exchange(&all.pushed_out, 0ull);
  for (int d = 0; d < 3; ++d) found.pushed_momentum[d] = block.exchange(&all.pushed_momentum[d], 0ull);
  block.exchange(&all.blocks_done, 0);
  finish_substep(view.scenes[scene], found, number_of(found.speed2), number_of(found.sound_speed), control);
}

template <typename Block>
GRAUPEL_HD void grid_to_particle(const Block& block, const BatchView& view, GatherShared& shared) {
  const int home = block.index();
  if (home >= view.counts->homes_to_run()) return;
  const HomeBlock b = home_block(view, view.home_key[home]);
  const StepControl& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  const SceneView<float>& scene = view.scenes[b.scene].view;
  const float dt = control.dt;
  const int t = block.thread();
  if (t < 27) {
    const int32_t key = neighbor_key(view, b, t / 9 - 1, t / 3 % 3 - 1, t % 3 - 1);
    shared.neighbor[t] = key < 0 ? -1 : view.node_of_key[key];
  }
  if (t == 0) clear_report(shared.report);
  block.sync();
  for (int n = t; n < reach_nodes; n += block_threads) {
    int corner = 0, inside = 0;
    const int at[3] = {n / 64 + 3, n / 8 % 8 + 3, n % 8 + 3};  // node -1..6 of the block, plus 4
    for (int d = 0; d < 3; ++d) {
      corner = corner * 3 + at[d] / block_width;
      inside = inside * block_width + at[d] % block_width;
    }
    const int64_t number = shared.neighbor[corner];
    shared.node[reach_index(n / 64, n / 8 % 8, n % 8)] =
        number < 0 ? NodeSum{} : view.nodes[number * nodes_per_block<3> + inside];
  }
  block.sync();
  Survey found;
  bool inside = true;
  for (int32_t slot = view.start[home] + t; slot < view.start[home + 1]; slot += block_threads)
    inside = advance_particle(view, scene, b.at, shared.node, slot, dt, found) && inside;
  report_particle(block, found, inside, shared.report);
  block.sync();
  if (t == 0) report_block(block, view, b.scene, shared.report);
}

}  // namespace graupel::mpm::batch
