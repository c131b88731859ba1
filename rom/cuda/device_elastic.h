// Decoding of a model of the deformation alone (rom/deformation/mode_deformation.h): a block takes 32 points, a lane
// each, whose modes its warps divide. A lane then has position, velocity and F of a point, and the stress by its
// material's law; the affine velocity is zero. Contributions to nodes are those of the other models
// (rom/cuda/device_decode.h). Where blocks were marked anew, groups of 32 with points in reach of them are listed.
#pragma once

#include "mpm/materials/jelly.h"
#include "mpm/materials/list.h"
#include "mpm/materials/neo_hookean.h"
#include "rom/cuda/device_branch.h"
#include "rom/cuda/device_decode.h"

namespace graupel::rom::device {

inline constexpr int motion_components = 15;  ///< x - X, velocity, F - I row by row
inline constexpr int decoded_stride = 28;     ///< of a point for scatter_point(), not all in the same banks

struct ElasticShared {
  float coefficient[most_latents], rate[most_latents];
  float sums[step_warps][motion_components][warp_width];  ///< over the modes of a warp
  alignas(16) float decoded[warp_width][decoded_stride];
  uint32_t taken;  ///< bit l: the point of lane l takes part
};

/// The first kernel's work for such a model: sums are cleared, or blocks marked; there are no maps.
template <typename Block>
GRAUPEL_HD void prepare(const Block& block, const RunView& view, BranchShared& shared) {
  const InstanceView& instance = view.instances[block.index() / view.worker_blocks];
  if (instance.state->status != RunStatus::running) return;
  prepare_nodes(block, view, instance, block.index() % view.worker_blocks, shared);
}

/// Kirchhoff stress of the laws that such a model may have; none of a stationary material.
GRAUPEL_HD inline Mat<float, 3> elastic_stress(const mpm::MaterialParameters<float>& material, const Mat<float, 3>& F) {
  Mat<float, 3> tau = Mat<float, 3>::zero();
  mpm::with_law(mpm::LawList<mpm::JellyLaw, mpm::NeoHookeanLaw>{}, material.model, [&](auto law) {
    float J = 1;
    tau = decltype(law)::update(material, F, J);
  });
  return tau;
}

template <typename Block>
struct ElasticDecode {
  const Block& block;
  const RunView& view;
  const ModelView& model;
  const InstanceView& instance;
  ElasticShared& shared;

  GRAUPEL_HD int lane() const { return block.thread() % warp_width; }
  GRAUPEL_HD int warp() const { return block.thread() / warp_width; }

  GRAUPEL_HD void load() const {
    for (int k = block.thread(); k < model.latents; k += block.threads()) {
      shared.coefficient[k] = static_cast<float>(instance.coefficient[k]);
      shared.rate[k] = static_cast<float>(instance.rate[k]);
    }
    constexpr int affine = 12;  // place of the affine velocity, which stays 0
    for (int i = block.thread(); i < warp_width * 9; i += block.threads()) shared.decoded[i / 9][affine + i % 9] = 0;
  }

  /// Sums over the warp's modes.
  GRAUPEL_HD void add_modes(int32_t group) const {
    float sum[motion_components] = {};
    for (int k = warp(); k < model.latents; k += step_warps) {
      const float* const mode = model.point_modes + (int64_t(group) * model.latents + k) * mode_components * warp_width;
      float u[mode_components];
      GRAUPEL_UNROLL
      for (int c = 0; c < mode_components; ++c) u[c] = mode[c * warp_width + lane()];
      const float a = shared.coefficient[k], rate = shared.rate[k];
      GRAUPEL_UNROLL
      for (int c = 0; c < 3; ++c) {
        sum[c] += a * u[c];
        sum[3 + c] += rate * u[c];
      }
      GRAUPEL_UNROLL
      for (int c = 0; c < 9; ++c) sum[6 + c] += a * u[3 + c];
    }
    GRAUPEL_UNROLL
    for (int c = 0; c < motion_components; ++c) shared.sums[warp()][c][lane()] = sum[c];
  }

  /// Of all warps, into those of the first.
  GRAUPEL_HD void join_warps() const {
    const int warps = model.latents < step_warps ? model.latents : step_warps;
    for (int i = block.thread(); i < motion_components * warp_width; i += block.threads()) {
      float* const first = &shared.sums[0][0][0] + i;
      float sum = *first;
      for (int w = 1; w < warps; ++w) sum += first[w * motion_components * warp_width];
      *first = sum;
    }
  }

  /// A lane's point as scatter_point() reads it; its position.
  GRAUPEL_HD Vec<float, 3> take_stress(int32_t group, int32_t point) const {
    const auto sum = [&](int c) { return shared.sums[0][c][lane()]; };
    float* const to = shared.decoded[lane()];
    Mat<float, 3> F = Mat<float, 3>::identity();
    Vec<float, 3> x;
    for (int c = 0; c < 3; ++c) {
      x[c] = model.point_reference[(int64_t(group) * 3 + c) * warp_width + lane()] + sum(c);
      to[c] = x[c];
      to[3 + c] = sum(3 + c);
      for (int d = 0; d < 3; ++d) F(c, d) += sum(6 + 3 * c + d);
    }
    const Mat<float, 3> tau = elastic_stress(instance.scene.materials[instance.point_material[point]], F);
    for (int c = 0; c < 3; ++c) to[6 + c] = tau(c, c);
    to[9] = tau(0, 1);
    to[10] = tau(0, 2);
    to[11] = tau(1, 2);
    return x;
  }

  /// Whether a stencil at this position has a corner in a marked block, as reaches_marked() finds it with a warp.
  GRAUPEL_HD static bool reaches(const MarkedGrid& grid, const Vec<float, 3>& x) {
    const GridStencil s = grid.stencil_at(x);
    for (int corner = 0; s.inside && corner < 8; ++corner) {
      Vec<int, 3> at = s.base;
      for (int d = 0; d < 3; ++d) at[d] += 2 * (corner >> d & 1);
      if (grid.is_marked(at)) return true;
    }
    return false;
  }

  /// By the first warp: stress of the points, and which of them take part.
  GRAUPEL_HD void finish_points(const MarkedGrid& grid, int32_t group, bool due) const {
    const int32_t point = group * warp_width + lane();
    bool reached = false;
    if (point < model.points) {
      const Vec<float, 3> x = take_stress(group, point);
      reached = due && reaches(grid, x);
    }
    const uint32_t found = block.ballot(reached);
    if (lane() != 0) return;
    shared.taken = due ? found : instance.group_points[group];
    if (!due) return;
    instance.group_points[group] = found;
    if (found == 0) return;
    const int32_t place = block.add(&instance.state->group_count, int32_t{1});
    if (place < model.point_groups()) instance.groups[place] = group;  // kernels that are timed alone find them again
    block.add(&instance.state->point_count, ones_of(found));
  }

  GRAUPEL_HD void take_group(const MarkedGrid& grid, int32_t group, bool due) const {
    add_modes(group);
    block.sync();
    join_warps();
    block.sync();
    if (warp() == 0) finish_points(grid, group, due);
    block.sync();
    const uint32_t taken = shared.taken;
    for (int p = warp(); p < warp_width; p += step_warps)
      if ((taken >> p & 1) != 0) scatter_point(block, view, instance, grid, group * warp_width + p, shared.decoded[p]);
    block.sync();
  }
};

/// The second kernel.
template <typename Block>
GRAUPEL_HD void decode_elastic(const Block& block, const RunView& view, ElasticShared& shared) {
  const InstanceView& instance = view.instances[block.index() / view.decode_blocks];
  if (instance.state->status != RunStatus::running) return;
  const ElasticDecode<Block> decode{block, view, view.model, instance, shared};
  decode.load();
  block.sync();
  const MarkedGrid grid(instance);
  const bool due = instance.state->due != 0;
  const int32_t groups = view.model.point_groups(), listed = instance.state->group_count;
  const int32_t count = due ? groups : (listed < groups ? listed : groups);
  for (int32_t i = block.index() % view.decode_blocks; i < count; i += view.decode_blocks)
    decode.take_group(grid, due ? i : instance.groups[i], due);
}

}  // namespace graupel::rom::device
