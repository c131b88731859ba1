// The third kernel of a reduced-order model's step: a warp moves a sample. Each lane makes its node's sums a velocity
// (gravity, contact) and the warp reads it; the ways of all samples are then projected onto the modes, which is all
// that the fit needs of them. Samples of a deformation alone have weights in the fit, `weighed`
// (rom/solver/particle_grid.h).
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

struct GatherShared {
  double projection[most_deformation_modes];  ///< U^T way of the block's samples
  double moved2;                              ///< sum of the squares of their ways [m^2]
  int32_t furthest;                           ///< bits of the longest way's square
  int32_t lost;                               ///< samples
  double weight, weighted2;                   ///< as in WaySums
  float way[step_warps][4];                   ///< [m], and the sample's weight
};

/// Velocity after gravity and contact at a node of the grid with these sums; zero without mass.
GRAUPEL_HD inline Vec<float, 3> node_velocity(const RunView& view, const InstanceView& instance, const Vec<int, 3>& at,
                                              const float* sums) {
  const mpm::SceneView<float>& scene = instance.scene;
  const float mass = sums[3];
  if (!(mass > 0.0f)) return Vec<float, 3>::zero();
  Vec<int, 3> block;
  int inside = 0;
  for (int d = 0; d < 3; ++d) {
    block[d] = at[d] / mpm::block_width;
    inside = inside * mpm::block_width + at[d] % mpm::block_width;
  }
  const Vec<float, 3> x = scene.grid.node_position(at);
  const int32_t key = scene.grid.directory_index(block);
  const mpm::MovingObstacleView<float> moving = instance.moving(instance.state->step);
  const Vec<float, 3> momentum = {sums[0], sums[1], sums[2]};
  const auto dt = static_cast<float>(view.dt);
  return moving.count > 0 ? mpm::updated_velocity<true, 3>(scene, moving, key, inside, x, momentum, mass, dt)
                          : mpm::updated_velocity<false, 3>(scene, moving, key, inside, x, momentum, mass, dt);
}

/// How far a sample goes with velocity v, at most a cell. The way [m] is not rounded to the precision of positions
/// where nothing is in the way: that would count in velocities.
GRAUPEL_HD inline Vec<float, 3> sample_way(const RunView& view, const InstanceView& instance, bool kinematic,
                                           const Vec<double, 3>& before, const Vec<float, 3>& v) {
  const mpm::SceneView<float>& scene = instance.scene;
  const auto dt = static_cast<float>(view.dt);
  const Vec<float, 3> from = before.cast<float>(), step = dt * v, wanted = from + step;
  Vec<float, 3> x = from, slowed = v, way = step;
  mpm::StepStatistics unused;
  mpm::move_point<true, 3>(scene, instance.moving(instance.state->step), kinematic, 0, 1.0f, dt, x, slowed, unused);
  for (int d = 0; d < 3; ++d)
    if (!(x[d] == wanted[d] && slowed[d] == v[d])) way[d] = static_cast<float>(static_cast<double>(x[d]) - before[d]);
  return way;
}

/// Share of a sample's B-spline on nodes that moving obstacles hold, if it does not go away from these with velocity v;
/// a node a lane, the same in all lanes.
template <typename Block>
GRAUPEL_HD float pushed_share(const Block& block, const InstanceView& instance, const Vec<float, 3>& x,
                              const GridStencil& s, const Vec<float, 3>& v) {
  const int lane = block.thread() % warp_width;
  float share = 0;
  if (s.inside && lane < stencil_nodes) {
    const float dx = instance.scene.grid.dx;
    Vec<float, 3> from_sample;
    float w = 1;
    for (int d = 0; d < 3; ++d) {
      from_sample[d] = static_cast<float>(stencil_node(lane)[d]) - s.fx[d];
      w *= mpm::bspline(from_sample[d]);
    }
    if (mpm::node_pushes(instance.moving(instance.state->step), x + dx * from_sample, dx, v)) share = w;
  }
  return sum_of_warp(block, share);
}

template <bool weighed, typename Block>
GRAUPEL_HD void gather_sample(const Block& block, const RunView& view, const InstanceView& instance, int sample,
                              float* to) {
  const int lane = block.thread() % warp_width;
  const Vec<double, 3> before = sample_position(block, view.model, instance.coefficient, sample);
  const MarkedGrid grid(instance);
  const GridStencil s = grid.stencil_at(before.cast<float>());
  Vec<float, 3> v = Vec<float, 3>::zero();
  if (s.inside && lane < stencil_nodes) {
    const Vec<int, 3> offset = stencil_node(lane), at = s.base + offset;
    const float* const sums = grid.sums_of(at);
    float w = 1;
    for (int d = 0; d < 3; ++d) w *= mpm::bspline(static_cast<float>(offset[d]) - s.fx[d]);
    if (sums != nullptr) v = w * node_velocity(view, instance, at, sums);
  }
  for (int d = 0; d < 3; ++d) v[d] = sum_of_warp(block, v[d]);
  const mpm::RigidStep<float>* const leader =
      instance.sample_script == nullptr ? nullptr
                                        : instance.leader(instance.sample_script[sample], instance.state->step);
  if (leader != nullptr) v = leader->velocity_at(before.cast<float>());
  float weight = 1;
  if constexpr (weighed)
    if (view.contact_weight > 1 && instance.moving_count > 0)
      weight += (view.contact_weight - 1) * pushed_share(block, instance, before.cast<float>(), s, v);
  if (lane != 0) return;
  const bool still = leader == nullptr && instance.sample_still[sample] != 0;
  const bool fits = s.inside && mpm::within_a_cell(static_cast<float>(view.dt) * v, instance.scene.grid.dx);
  const Vec<float, 3> way =
      !fits || still ? Vec<float, 3>::zero() : sample_way(view, instance, leader != nullptr, before, v);
  for (int d = 0; d < 3; ++d) to[d] = way[d];
  const bool lost = !fits && !still;
  instance.lost[sample] = lost ? 1 : 0;
  to[3] = lost ? 0 : weight;
}

/// Adds a sample's way to the block's sums, a mode a lane.
template <bool weighed, typename Block>
GRAUPEL_HD void project_way(const Block& block, const RunView& view, const InstanceView& instance, int sample,
                            const float* way, GatherShared& shared) {
  const ModelView& model = view.model;
  const int lane = block.thread() % warp_width;
  for (int k = lane; k < model.deformation_modes; k += warp_width) {
    const float* const mode = model.sample_modes + int64_t(k) * model.sample_rows + 3 * sample;
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += static_cast<double>(mode[c]) * static_cast<double>(way[c]);
    if constexpr (weighed) sum *= static_cast<double>(way[3]);
    block.add(shared.projection + k, sum);
  }
  if (lane != 0) return;
  double way2 = 0;
  for (int c = 0; c < 3; ++c) way2 += static_cast<double>(way[c]) * static_cast<double>(way[c]);
  const auto rounded = static_cast<float>(way2);
  int32_t bits;
  __builtin_memcpy(&bits, &rounded, sizeof bits);
  block.add(&shared.moved2, way2);
  block.max(&shared.furthest, bits);
  if (instance.lost[sample] != 0) block.add(&shared.lost, int32_t{1});
  if constexpr (!weighed) return;
  block.add(&shared.weight, static_cast<double>(way[3]));
  block.add(&shared.weighted2, static_cast<double>(way[3]) * way2);
  if (way[3] == 1) return;
  instance.weight[sample] = way[3];
  instance.weighed[block.add(&instance.ways->weighed, int32_t{1})] = sample;
}

template <bool weighed, typename Block>
GRAUPEL_HD void gather(const Block& block, const RunView& view, GatherShared& shared) {
  const InstanceView& instance = view.instances[block.index() / view.gather_blocks];
  if (instance.state->status != RunStatus::running) return;
  for (int k = block.thread(); k < view.model.deformation_modes; k += block.threads()) shared.projection[k] = 0;
  if (block.thread() == 0) {
    shared.moved2 = shared.weight = shared.weighted2 = 0;
    shared.furthest = shared.lost = 0;
  }
  block.sync();
  const int warp = block.thread() / warp_width;
  for (int sample = block.index() % view.gather_blocks * step_warps + warp; sample < view.model.samples;
       sample += view.gather_blocks * step_warps) {
    gather_sample<weighed>(block, view, instance, sample, shared.way[warp]);
    block.sync_warp();
    project_way<weighed>(block, view, instance, sample, shared.way[warp], shared);
    block.sync_warp();
  }
  block.sync();
  WaySums& sums = *instance.ways;
  for (int k = block.thread(); k < view.model.deformation_modes; k += block.threads())
    block.add(sums.projection + k, shared.projection[k]);
  if (block.thread() != 0) return;
  block.add(&sums.moved2, shared.moved2);
  block.max(&sums.furthest, shared.furthest);
  if (shared.lost > 0) block.add(&sums.lost, shared.lost);
  if constexpr (!weighed) return;
  block.add(&sums.weight, shared.weight);
  block.add(&sums.weighted2, shared.weighted2);
}

}  // namespace graupel::rom::device
