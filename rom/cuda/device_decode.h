// The second kernel of a reduced-order model's step: a warp decodes an integration point's fields, its lanes then add
// the point's share to their nodes. Nothing of a point is stored: its position, velocity, stress and affine velocity
// live in a warp. Where blocks were marked anew, the points in reach of them are found on the way. A
// block more prepares the fit meanwhile.
#pragma once

#include "rom/cuda/device_equations.h"

namespace graupel::rom::device {

struct DecodeShared {
  float deformation[most_deformation_modes], rate[most_deformation_modes];
  float stress[most_field_modes], affine[most_field_modes];  ///< times the modes' scales
  alignas(16) float decoded[step_warps][warp_width];
  int32_t points;  ///< found by the block
};

template <typename Block>
GRAUPEL_HD void load_coefficients(const Block& block, const RunView& view, const InstanceView& instance,
                                  DecodeShared& shared) {
  const ModelView& model = view.model;
  const int first = block.thread(), step = block.threads(), r = model.latents;
  for (int k = first; k < model.deformation_stride; k += step) {
    const bool real = k < model.deformation_modes;
    shared.deformation[k] = real ? static_cast<float>(instance.coefficient[k]) : 0.0f;
    const double rate = !real                       ? 0
                        : instance.state->steps > 0 ? (instance.coefficient[k] - instance.earlier[k]) / view.dt
                                                    : instance.rate[k];
    shared.rate[k] = static_cast<float>(rate);
  }
  for (int k = first; k < model.stress_stride; k += step)
    shared.stress[k] = k < model.stress_modes ? static_cast<float>(instance.map_rows[k]) * model.stress_scale[k] : 0.0f;
  const double* const rows = instance.map_rows + model.stress_map.outputs;
  for (int k = first; k < model.affine_stride; k += step) {
    double a = 0;
    if (k < model.affine_modes) {
      if (model.affine_is_rate)
        for (int j = 0; j < r; ++j) a += rows[k * r + j] * instance.state->velocity[j];
      else
        a = rows[k];
      a *= static_cast<double>(model.affine_scale[k]);
    }
    shared.affine[k] = static_cast<float>(a);
  }
}

/// A lane's coefficients of the first group of modes, which are all modes of most models.
struct LaneMotion {
  float deformation, rate;
  template <typename Block>
  GRAUPEL_HD LaneMotion(const Block& block, const DecodeShared& shared)
      : deformation(shared.deformation[block.thread() % warp_width]), rate(shared.rate[block.thread() % warp_width]) {}
};
struct LaneFields {
  float stress[2], affine[2];
  template <typename Block>
  GRAUPEL_HD LaneFields(const Block& block, const DecodeShared& shared) {
    const int k = 2 * (block.thread() % 16);
    for (int i = 0; i < 2; ++i) {
      stress[i] = shared.stress[k + i];
      affine[i] = shared.affine[k + i];
    }
  }
};

/// Half of `count` values goes to the lane whose number differs in the bit `mask`, the other half is kept, with the
/// partner's added.
template <int count, typename Block>
GRAUPEL_HD inline void exchange_halves(const Block& block, int mask, float* value) {
  const bool upper = (block.thread() % warp_width & mask) != 0;
  GRAUPEL_UNROLL
  for (int i = 0; i < count / 2; ++i) {
    const float given = upper ? value[i] : value[i + count / 2], kept = upper ? value[i + count / 2] : value[i];
    value[i] = kept + block.shuffle_xor(given, mask);
  }
}

/// What a lane reads of a point's modes, of the first group of each field: asked for while the point before is at work.
struct PointModes {
  float deformation[3];
  uint32_t pair[stress_pairs + affine_pairs];
};
template <typename Block>
GRAUPEL_HD PointModes load_modes(const Block& block, const ModelView& model, int32_t point) {
  const int lane = block.thread() % warp_width;
  PointModes modes;
  const float* const deformation =
      model.deformation + int64_t(model.point_particle[point]) * 3 * model.deformation_stride + lane;
  GRAUPEL_UNROLL
  for (int c = 0; c < 3; ++c) modes.deformation[c] = deformation[c * model.deformation_stride];
  const uint32_t* const stress = model.stress + int64_t(point) * stress_pairs * model.stress_stride + lane;
  const uint32_t* const affine = model.affine + int64_t(point) * affine_pairs * model.affine_stride + lane;
  GRAUPEL_UNROLL
  for (int p = 0; p < stress_pairs; ++p) modes.pair[p] = stress[p * warp_width];
  GRAUPEL_UNROLL
  for (int p = 0; p < affine_pairs; ++p) modes.pair[stress_pairs + p] = affine[p * warp_width];
  return modes;
}

/// Position and velocity of a particle into to[0 .. 5]; a mode a lane, the first of each component given.
template <typename Block>
GRAUPEL_HD void decode_deformation(const Block& block, const ModelView& model, int64_t particle, const float* given,
                                   const LaneMotion& own, const DecodeShared& shared, float* to) {
  const int lane = block.thread() % warp_width;
  float value[8] = {};
  GRAUPEL_UNROLL
  for (int c = 0; c < 3; ++c) {
    value[c] = given[c] * own.deformation;
    value[3 + c] = given[c] * own.rate;
  }
  const float* const modes = model.deformation + particle * 3 * model.deformation_stride;
  for (int k = lane + warp_width; k < model.deformation_stride; k += warp_width)
    for (int c = 0; c < 3; ++c) {
      const float mode = modes[c * model.deformation_stride + k];
      value[c] += mode * shared.deformation[k];
      value[3 + c] += mode * shared.rate[k];
    }
  exchange_halves<8>(block, 16, value);
  exchange_halves<4>(block, 8, value);
  exchange_halves<2>(block, 4, value);
  float sum = value[0] + block.shuffle_xor(value[0], 2);
  sum += block.shuffle_xor(sum, 1);
  const int n = (lane & 16) / 4 + (lane & 8) / 4 + (lane & 4) / 4;  // whose sum this lane has
  if (lane % 4 != 0 || n >= 6) return;
  to[n] = n < 3 ? sum + model.deformation_mean[3 * particle + n] : sum;
}

/// Stress and affine velocity of a point into to[6 .. 20]; two modes a lane, of even components in the lower half of
/// the warp and of odd ones in the upper half, the first of each given.
template <typename Block>
GRAUPEL_HD void decode_fields(const Block& block, const ModelView& model, int32_t point, const uint32_t* given,
                              const LaneFields& own, const DecodeShared& shared, float* to) {
  const int lane = block.thread() % warp_width, k = 2 * (lane % 16), odd = lane / 16;
  float value[8] = {};
  const auto add_pair = [&](float& sum, uint32_t pair, const float* coefficient) {
    sum += float_of_half(static_cast<uint16_t>(pair)) * coefficient[0];
    sum += float_of_half(static_cast<uint16_t>(pair >> 16)) * coefficient[1];
  };
  const auto add_field = [&](auto pairs, int at, const uint32_t* rows, int stride, const float* first_two,
                             const float* coefficient) {
    constexpr int count = decltype(pairs)::value;  // of components
    GRAUPEL_UNROLL
    for (int p = 0; p < count; ++p) add_pair(value[at + p], given[at + p], first_two);
    const uint32_t* row = rows + int64_t(point) * count * stride + lane;
    for (int first = field_group; first < stride; first += field_group) {
      row += count * field_group;
      for (int p = 0; p < count; ++p) add_pair(value[at + p], row[p * warp_width], coefficient + first + k);
    }
  };
  add_field(std::integral_constant<int, stress_pairs>{}, 0, model.stress, model.stress_stride, own.stress,
            shared.stress);
  add_field(std::integral_constant<int, affine_pairs>{}, stress_pairs, model.affine, model.affine_stride, own.affine,
            shared.affine);
  exchange_halves<8>(block, 8, value);
  exchange_halves<4>(block, 4, value);
  exchange_halves<2>(block, 2, value);
  const float sum = value[0] + block.shuffle_xor(value[0], 1);
  const int n = 2 * ((lane & 8) / 2 + (lane & 4) / 2 + (lane & 2) / 2) + odd;  // component whose sum this lane has
  if (lane % 2 == 0 && n < field_components) to[6 + n] = sum + model.field_mean[int64_t(point) * field_components + n];
}

/// Adds to the four sums of a node.
template <typename Block>
GRAUPEL_HD inline void add_to_node(const Block& block, float* node, const Vec<float, 3>& momentum, float mass) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  atomicAdd(reinterpret_cast<float4*>(node), make_float4(momentum[0], momentum[1], momentum[2], mass));
#else
  for (int c = 0; c < 3; ++c) block.add(node + c, momentum[c]);
  block.add(node + 3, mass);
#endif
}

/// A lane's node of the stencil takes its share: w (m v + A (x_i - x_p)) with A = m C - dt V0 (4 / dx^2) tau
/// (mpm/physics/transfer.h).
template <typename Block>
GRAUPEL_HD void scatter_point(const Block& block, const RunView& view, const InstanceView& instance,
                              const MarkedGrid& grid, int32_t point, const float* from) {
  const int lane = block.thread() % warp_width;
  if (lane >= stencil_nodes) return;
  float decoded[24];
  __builtin_memcpy(decoded, __builtin_assume_aligned(from, 16), sizeof decoded);
  const Vec<float, 3> x = {decoded[0], decoded[1], decoded[2]};
  const GridStencil s = grid.stencil_at(x);
  if (!s.inside) return;
  const Vec<int, 3> offset = stencil_node(lane);
  float* const sums = grid.sums_of(s.base + offset);
  if (sums == nullptr) return;
  Vec<float, 3> v = {decoded[3], decoded[4], decoded[5]};
  Mat<float, 3> C;
  for (int i = 0; i < 9; ++i) C(i / 3, i % 3) = decoded[12 + i];
  const mpm::RigidStep<float>* const leader =
      instance.point_script == nullptr ? nullptr : instance.leader(instance.point_script[point], instance.state->step);
  if (leader != nullptr) {
    v = leader->velocity_at(x);
    C = leader->gradient;
  }
  const Mat<float, 3> tau = {{{decoded[6], decoded[9], decoded[10]},
                              {decoded[9], decoded[7], decoded[11]},
                              {decoded[10], decoded[11], decoded[8]}}};
  const float mass = instance.point_mass[point];
  const Mat<float, 3> A = mpm::affine_momentum(mass, instance.point_volume[point], static_cast<float>(view.dt),
                                               grid.grid.dx, grid.grid.inverse_dx, C, tau);
  float w = 1;
  Vec<float, 3> from_point;
  for (int d = 0; d < 3; ++d) {
    from_point[d] = static_cast<float>(offset[d]) - s.fx[d];
    w *= mpm::bspline(from_point[d]);
  }
  add_to_node(block, sums, w * (mass * v + A * from_point), w * mass);
}

/// Whether a stencil at this position has a corner in a marked block: a box of three nodes that meets one, which is
/// larger, has.
template <typename Block>
GRAUPEL_HD bool reaches_marked(const Block& block, const MarkedGrid& grid, const Vec<float, 3>& x) {
  const int lane = block.thread() % warp_width;
  const GridStencil s = grid.stencil_at(x);
  bool reaches = false;
  if (s.inside && lane < 8) {
    Vec<int, 3> corner = s.base;
    for (int d = 0; d < 3; ++d) corner[d] += 2 * (lane >> d & 1);
    reaches = grid.is_marked(corner);
  }
  return block.ballot(reaches) != 0;
}

/// A point whose modes are there. Where blocks were marked anew (`due`), whether it takes part is found first.
template <typename Block>
GRAUPEL_HD void take_point(const Block& block, const RunView& view, const InstanceView& instance,
                           const MarkedGrid& grid, const LaneMotion& motion, const LaneFields& fields, int32_t point,
                           const PointModes& modes, bool due, DecodeShared& shared) {
  const int lane = block.thread() % warp_width;
  float* const decoded = shared.decoded[block.thread() / warp_width];
  decode_deformation(block, view.model, view.model.point_particle[point], modes.deformation, motion, shared, decoded);
  decode_fields(block, view.model, point, modes.pair, fields, shared, decoded);
  block.sync_warp();
  bool taken = true;
  if (due) {
    taken = reaches_marked(block, grid, {decoded[0], decoded[1], decoded[2]});
    if (lane == 0) {
      instance.point_taken[point] = taken ? 1 : 0;
      if (taken) block.add(&shared.points, int32_t{1});
    }
  }
  if (taken) scatter_point(block, view, instance, grid, point, decoded);
  block.sync_warp();
}

template <typename Block>
GRAUPEL_HD void decode(const Block& block, const RunView& view, DecodeShared& shared, double* equation_room) {
  const int per_instance = 1 + view.decode_blocks, part = block.index() % per_instance;
  const InstanceView& instance = view.instances[block.index() / per_instance];
  if (instance.state->status != RunStatus::running) return;
  if (part == 0)
    return Equations<Block>{block, view.model, instance, {equation_room, view.model}}.solve(view.model.gram);
  load_coefficients(block, view, instance, shared);
  if (block.thread() == 0) shared.points = 0;
  block.sync();
  const MarkedGrid grid(instance);
  const LaneMotion motion(block, shared);
  const LaneFields fields(block, shared);
  const bool due = instance.state->due != 0;
  const int32_t points = view.model.points, step = view.decode_blocks * step_warps;
  const auto next = [&](int32_t point) {
    while (point < points && !due && instance.point_taken[point] == 0) point += step;
    return point;
  };
  int32_t point = next((part - 1) * step_warps + block.thread() / warp_width);
  PointModes modes{};
  if (point < points) modes = load_modes(block, view.model, point);
  while (point < points) {
    const int32_t after = next(point + step);
    PointModes upcoming{};
    if (after < points) upcoming = load_modes(block, view.model, after);
    take_point(block, view, instance, grid, motion, fields, point, modes, due, shared);
    modes = upcoming;
    point = after;
  }
  if (!due) return;
  block.sync();
  if (block.thread() == 0 && shared.points > 0) block.add(&instance.state->point_count, shared.points);
}

// frames -------------------------------------------------------------------------------------------------------------

/// Position and velocity of all particles of an instance, [particles, 6].
template <typename Block>
GRAUPEL_HD void write_frame(const Block& block, const RunView& view, int number, float* frame, DecodeShared& shared) {
  const InstanceView& instance = view.instances[number];
  const ModelView& model = view.model;
  for (int k = block.thread(); k < model.deformation_stride; k += block.threads()) {
    const bool real = k < model.deformation_modes;
    // Until the next step begins, instance.coefficient is of the state before the last one.
    shared.deformation[k] = real ? static_cast<float>(instance.reached[k]) : 0.0f;
    shared.rate[k] = real ? static_cast<float>(instance.rate[k]) : 0.0f;
  }
  block.sync();
  const LaneMotion motion(block, shared);
  const int warp = block.thread() / warp_width, lane = block.thread() % warp_width;
  for (int32_t p = block.index() * step_warps + warp; p < model.particles; p += block.blocks() * step_warps) {
    float given[3];
    for (int c = 0; c < 3; ++c) given[c] = model.deformation[(3 * int64_t(p) + c) * model.deformation_stride + lane];
    decode_deformation(block, model, p, given, motion, shared, shared.decoded[warp]);
    block.sync_warp();
    if (lane < 6) frame[6 * int64_t(p) + lane] = shared.decoded[warp][lane];
    block.sync_warp();
  }
}

}  // namespace graupel::rom::device
