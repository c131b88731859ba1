// P2G of one owner block: its particles' momentum and mass summed into its arena. Equals
// mpm/phases/particle_to_grid.cpp; gain: mpm/gpu/blocks/batch_kernels.h.
//
// A warp takes 32 particles at a time. Nine lanes stand for the nine rows of a stencil (three nodes along z each) and
// walk through a third of the particles, each summing its own nodes in registers; three such groups share a warp. When
// the base node changes, a group adds its sums to the warp's arena in shared memory, one group after the other.
//
// The order of all sums depends on the block's particles alone, whatever the number of warps: every 256 particles are
// four streams of 64, each with an arena of its own, added in order.
#pragma once

#include "core/parallel/thread_block.h"
#include "mpm/gpu/blocks/batch_owner_blocks.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm::batch {

inline constexpr int streams = 4;           ///< arenas that a round of particles is summed in
inline constexpr int chunks_per_round = 2;  ///< a chunk is 32 particles of a stream
inline constexpr int round_particles = streams * warp_width * chunks_per_round;
inline constexpr int scatter_groups = 3;
inline constexpr int group_lanes = 9;
inline constexpr int group_size = 11;  ///< most particles of a group: a third of a warp's 32

/// A particle as the lanes of a warp read it: its sums at node (i, j, k) of its stencil are w (q + A (i, j, k)), w m.
struct alignas(16) StagedParticle {
  float fx[3], mass;
  float q[3];
  int32_t base;  ///< arena index before the turn of rows: x * 64 + y * 8 + z
  float A[3][4];
};

template <int Warps>
struct ScatterShared {
  NodeSum arena[Warps][halo_nodes];
  StagedParticle staged[Warps][warp_width];
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

GRAUPEL_HD inline StagedParticle stage_particle(const ParticleView<float>& p, const SceneView<float>& scene,
                                                const Vec<int, 3>& block, int64_t slot, float dt) {
  const Stencil<float, 3> stencil = halo_stencil(scene.grid, block, p.position.vec(slot));
  const float volume = p.volume.get(slot);
  const float mass = scene.materials[p.material.get(slot)].density * volume;
  const Mat<float, 3> A =
      affine_momentum(mass, volume, dt, scene.grid.dx, scene.grid.inverse_dx,
                      load_matrix<float, 3>(p.affine_velocity, slot), load_symmetric(p.stress, slot));
  const Vec<float, 3> q = mass * p.velocity.vec(slot) - A * stencil.fx;
  StagedParticle s;
  s.mass = mass;
  s.base = (stencil.base[0] * halo_width + stencil.base[1]) * halo_width + stencil.base[2];
  for (int r = 0; r < 3; ++r) {
    s.fx[r] = stencil.fx[r];
    s.q[r] = q[r];
    for (int c = 0; c < 3; ++c) s.A[r][c] = A(r, c);
    s.A[r][3] = 0;
  }
  return s;
}

/// The sums of one lane: three nodes along z.
struct RowSums {
  NodeSum node[3];
};

/// Adds one particle to the row (i, j) of a lane.
GRAUPEL_HD inline void add_to_row(const StagedParticle& s, const LaneWeight& wx, const LaneWeight& wy, float fi,
                                  float fj, RowSums& sums) {
  const float w = weight_at(wx, s.fx[0]) * weight_at(wy, s.fx[1]);
  const AxisWeights<float> wz = bspline_weights(s.fx[2]);
  float value[3], slope[3];
  for (int c = 0; c < 3; ++c) {
    value[c] = w * (s.q[c] + s.A[c][0] * fi + s.A[c][1] * fj);
    slope[c] = w * s.A[c][2];
  }
  const float mass = w * s.mass;
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < 3; ++c) sums.node[k].v[c] += wz.w[k] * (value[c] + static_cast<float>(k) * slope[c]);
    sums.node[k].v[3] += wz.w[k] * mass;
  }
}

/// Adds a lane's sums to the arena and clears them.
GRAUPEL_HD inline void flush_row(NodeSum* arena, int32_t base, int i, int j, RowSums& sums) {
  for (int k = 0; k < 3; ++k) {
    NodeSum& node = arena[halo_index(base / 64 + i, base / 8 % 8 + j, base % 8 + k)];
    NodeSum total = node;
    for (int c = 0; c < 4; ++c) total.v[c] += sums.node[k].v[c];
    node = total;
  }
  sums = {};
}

/// One chunk of a warp: `count` <= 32 particles from slot `first`.
template <typename Block>
GRAUPEL_HD void scatter_chunk(const Block& block, const ParticleView<float>& p, const SceneView<float>& scene,
                              const Vec<int, 3>& at, int32_t first, int32_t count, float dt, StagedParticle* staged,
                              NodeSum* arena) {
  const int lane = block.thread() % warp_width, group = lane / group_lanes;
  const int i = lane % group_lanes / 3, j = lane % 3;
  block.sync_warp();
  if (lane < count) staged[lane] = stage_particle(p, scene, at, first + lane, dt);
  block.sync_warp();
  const uint32_t changes =
      block.ballot(lane > 0 && lane < count && staged[lane].base != staged[lane > 0 ? lane - 1 : 0].base);
  const int begin = group * group_size;
  const int end = group >= scatter_groups ? begin : begin + group_size < count ? begin + group_size : count;
  const LaneWeight wx = lane_weight(i), wy = lane_weight(j);
  const float fi = static_cast<float>(i), fj = static_cast<float>(j);
  RowSums sums = {};
  for (int n = 0; n < group_size; ++n) {
    const uint32_t ends = changes >> n;
    if (n > 0 && (ends | ends >> group_size | ends >> 2 * group_size) & 1)
      for (int flushing = 0; flushing < scatter_groups; ++flushing) {
        if (!(ends >> (flushing * group_size) & 1)) continue;
        if (flushing == group) flush_row(arena, staged[begin + n - 1].base, i, j, sums);
        block.sync_warp();
      }
    if (begin + n < end) add_to_row(staged[begin + n], wx, wy, fi, fj, sums);
  }
  for (int flushing = 0; flushing < scatter_groups; ++flushing) {
    if (flushing == group && begin < end) flush_row(arena, staged[end - 1].base, i, j, sums);
    block.sync_warp();
  }
}

/// Sums the particles of a owner block into `arena` (halo_nodes). All threads of the block take part; the arena may be
/// read by others after the caller's next barrier. Warps is a multiple of `streams`.
template <int Warps, typename Block>
GRAUPEL_HD void scatter_block(const Block& block, const ParticleView<float>& p, const SceneView<float>& scene,
                              const OwnerBlock& owner, float dt, ScatterShared<Warps>& shared, NodeSum* arena) {
  constexpr int rounds_at_once = Warps / streams, threads = Warps * warp_width;
  constexpr int own_nodes = (halo_nodes + threads - 1) / threads;
  const int warp = block.thread() / warp_width, lane = block.thread() % warp_width;
  NodeSum total[own_nodes] = {};
  for (int32_t first = owner.begin; first < owner.end; first += rounds_at_once * round_particles) {
    int32_t mine = first + warp / streams * round_particles + warp % streams * warp_width;
    if (mine < owner.end)
      for (int n = lane; n < halo_nodes; n += warp_width) shared.arena[warp][n] = {};
    for (int chunk = 0; chunk < chunks_per_round; ++chunk, mine += streams * warp_width)
      if (mine < owner.end)
        scatter_chunk(block, p, scene, owner.at, mine, owner.end - mine < warp_width ? owner.end - mine : warp_width,
                      dt, shared.staged[warp], shared.arena[warp]);
    block.sync();
    for (int round = 0; round < rounds_at_once; ++round) {
      const int32_t left = owner.end - first - round * round_particles;
      if (left <= 0) break;
      const int used = left >= streams * warp_width ? streams : (left + warp_width - 1) / warp_width;
      for (int o = 0; o < own_nodes; ++o) {
        const int n = block.thread() + o * threads;
        NodeSum sum = shared.arena[round * streams][n];
        for (int other = 1; other < used; ++other)
          for (int c = 0; c < 4; ++c) sum.v[c] += shared.arena[round * streams + other][n].v[c];
        for (int c = 0; c < 4; ++c) total[o].v[c] += sum.v[c];
      }
    }
    if (first + rounds_at_once * round_particles < owner.end) block.sync();
  }
  for (int o = 0; o < own_nodes; ++o) arena[block.thread() + o * threads] = total[o];
}

}  // namespace graupel::mpm::batch
