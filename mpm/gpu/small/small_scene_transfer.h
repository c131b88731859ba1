// Between the particles of a small scene and its grids: G2P from the sums of one grid, P2G into the next, and clearing
// of the third.
#pragma once

#include "mpm/gpu/small/small_scene_changes.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm::small {

/// Velocity after gravity (`gain` [m/s]) of a node with these sums; zero without mass.
GRAUPEL_HD inline Vec<float, 3> free_node_velocity(float momentum_per_mass_unit, const Vec<float, 3>& gain,
                                                   const UnitPair& low, const UnitPair& high) {
  const float mass = static_cast<float>(high.b);
  const float scale = mass > 0.0f ? momentum_per_mass_unit * fast_reciprocal(mass) : 0.0f;
  return free_velocity(Vec<float, 3>{static_cast<float>(low.a), static_cast<float>(low.b), static_cast<float>(high.a)},
                       scale, gain);
}

GRAUPEL_HD inline Vec<int, 3> stencil_node(int node) { return {node / 9, node / 3 % 3, node % 3}; }

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
template <typename W>
GRAUPEL_HD void gather_chunk(const W& w, int32_t first, int32_t count, const UnitPair* sums) {
  const SceneView<float>& scene = w.scene.view;
  const SmallScene& small = w.small;
  const int part = w.lane() % particle_lanes;
  const Vec<float, 3> gain = w.dt * scene.gravity;
  const float per_mass = small.momentum_unit * small.per_mass_unit;
  constexpr int rounds = (stencil_nodes + particle_lanes - 1) / particle_lanes;
  for (int32_t n = 0; n < count; n += warp_width / particle_lanes) {
    const int32_t particle = n + w.lane() / particle_lanes, at = particle < count ? particle : count - 1;
    const int64_t slot = int64_t(small.first) + first + at;
    const Stencil<float, 3> s = stencil_at(scene.grid.local(w.view.particles.position.vec(slot)));
    bool present = true, near = false;
    if constexpr (W::View::changes) {
      present = is_present(w, slot);
      if (w.block.ballot(present) == 0) continue;
      near = present && meets_moving(w, s.base);
    }
    const int32_t base = present ? place_of(small, s.base) : 0;
    UnitPair low[rounds], high[rounds];
    NodeContact contact[rounds];
    GRAUPEL_UNROLL
    for (int r = 0; r < rounds; ++r) {
      const int node = part + particle_lanes * r < stencil_nodes ? part + particle_lanes * r : 0;
      const int32_t place = base + w.shared.node[node];
      low[r] = w.block.fresh(sums + 2 * int64_t(place));
      high[r] = w.block.fresh(sums + 2 * int64_t(place) + 1);
      contact[r] = contact_of(w, s.base + stencil_node(node), place, near);
    }
    float sum[12] = {};
    GRAUPEL_UNROLL
    for (int r = 0; r < rounds; ++r) {
      const int node = part + particle_lanes * r;
      const float offset[3] = {static_cast<float>(node / 9) - s.fx[0], static_cast<float>(node / 3 % 3) - s.fx[1],
                               static_cast<float>(node % 3) - s.fx[2]};
      const float w_node = node < stencil_nodes ? bspline(offset[0]) * bspline(offset[1]) * bspline(offset[2]) : 0.0f;
      const Vec<float, 3> v = w_node * apply_contact_of(w, s.base + stencil_node(node), contact[r],
                                                        free_node_velocity(per_mass, gain, low[r], high[r]));
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

/// P2G of a chunk: adds the staged particles to a grid. Four lanes stand for the four sums of a node, and twice four
/// share a particle: the others see the stencil from its far corner, with mirrored weights, and stop before the node in
/// its middle.
template <typename W>
GRAUPEL_HD void scatter_chunk(const W& w, int32_t count, UnitPair* sums) {
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
    if (W::View::changes && s.base < 0) continue;
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
template <typename W>
GRAUPEL_HD void clear_chunk(const W& w, int32_t first, int32_t count, const int32_t* bases, UnitPair* sums) {
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

/// What a particle adds that is not in the run.
GRAUPEL_HD inline Contribution no_contribution() {
  Contribution none = {};
  none.base = -1;
  return none;
}

/// Stages what the lanes' particles add, and remembers where.
template <typename W>
GRAUPEL_HD void stage(const W& w, int32_t first, int32_t count, const Contribution& contribution, int32_t* bases) {
  const int lane = w.lane();
  if (lane < count) {
    w.staged()[lane].contribution = contribution;
    bases[w.small.first + first + lane] = contribution.base;
  }
  w.block.sync_warp();
}

}  // namespace graupel::mpm::small
