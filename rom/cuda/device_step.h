// The kernels of a reduced-order model's step but the last (rom/cuda/device_fit.h), over core/thread_block.h:
//   branch   coefficients of stress and affine velocity; marked nodes cleared; points found where that is due
//   decode   a warp decodes an integration point's fields, its lanes then add the point's share to their nodes
//   gather   a warp moves a sample: each lane makes its node's sums a velocity (gravity, contact) and reads it
// Nothing of an integration point is stored: its position, velocity, stress and affine velocity live in a warp.
#pragma once

#include <type_traits>

#include "core/thread_block.h"
#include "mpm/moving_contact.h"
#include "mpm/particle_motion.h"
#include "rom/cuda/device_view.h"

#if defined(__CUDACC__)
#include <cuda_fp16.h>
#endif

namespace graupel::rom::device {

inline constexpr int step_warps = step_threads / warp_width;
inline constexpr int stencil_nodes = 27;
inline constexpr int decoded_values = 21;  ///< position, velocity, stress, affine velocity

/// IEEE half precision.
GRAUPEL_HD inline float float_of_half(uint16_t bits) {
#if defined(__CUDA_ARCH__)
  return __half2float(__ushort_as_half(bits));
#else
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  const float magnitude = exponent == 0    ? std::ldexp(static_cast<float>(fraction), -24)
                          : exponent == 31 ? (fraction != 0 ? NAN : INFINITY)
                                           : std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
  return bits >> 15 != 0 ? -magnitude : magnitude;
#endif
}

/// `value` of the lane whose number differs in the bits of `mask`.
template <typename Block>
GRAUPEL_HD inline double shuffle_xor(const Block& block, double value, int mask) {
  float halves[2];
  __builtin_memcpy(halves, &value, sizeof value);
  for (float& half : halves) half = block.shuffle_xor(half, mask);
  __builtin_memcpy(&value, halves, sizeof value);
  return value;
}
template <typename Block>
GRAUPEL_HD inline float shuffle_xor(const Block& block, float value, int mask) {
  return block.shuffle_xor(value, mask);
}

/// Sum over the lanes of a warp, the same in all of them.
template <typename Block, typename T>
GRAUPEL_HD inline T sum_of_warp(const Block& block, T value) {
  for (int mask = warp_width / 2; mask > 0; mask /= 2) value += shuffle_xor(block, value, mask);
  return value;
}

/// One exchange of sums_by_lane(): a lane gives away the half of its values that its partner keeps.
template <int half, typename Block>
GRAUPEL_HD inline void exchange_halves(const Block& block, int lane, float (&value)[warp_width]) {
  const bool upper = (lane & half) != 0;
  GRAUPEL_UNROLL
  for (int i = 0; i < half; ++i) {
    const float given = upper ? value[i] : value[i + half], kept = upper ? value[i + half] : value[i];
    value[i] = kept + block.shuffle_xor(given, half);
  }
}
/// Sums of 32 values over the lanes, each in the lane of its number.
template <typename Block>
GRAUPEL_HD inline float sums_by_lane(const Block& block, int lane, float (&value)[warp_width]) {
  exchange_halves<16>(block, lane, value);
  exchange_halves<8>(block, lane, value);
  exchange_halves<4>(block, lane, value);
  exchange_halves<2>(block, lane, value);
  exchange_halves<1>(block, lane, value);
  return value[0];
}

/// Base node of a position and the cells above it; `inside`: the whole stencil lies in the grid (false for NaN).
struct Stencil {
  Vec<int, 3> base;
  Vec<float, 3> fx;
  bool inside;
};
GRAUPEL_HD inline Stencil stencil_at(const InstanceView& instance, const Vec<float, 3>& x) {
  const Vec<float, 3> local = instance.scene.grid.local(x);
  Stencil s{Vec<int, 3>::zero(), Vec<float, 3>::zero(), true};
  for (int d = 0; d < 3; ++d)
    s.inside = s.inside && local[d] >= 0.5f && local[d] < static_cast<float>(instance.nodes[d]) - 2.0f;
  if (!s.inside) return s;
  s.base = mpm::base_node(local);
  for (int d = 0; d < 3; ++d) s.fx[d] = local[d] - static_cast<float>(s.base[d]);
  return s;
}
GRAUPEL_HD inline int64_t node_number(const Vec<int, 3>& nodes, const Vec<int, 3>& at) {
  return (int64_t(at[0]) * nodes[1] + at[1]) * nodes[2] + at[2];
}
GRAUPEL_HD inline Vec<int, 3> stencil_node(int n) { return {n / 9, n / 3 % 3, n % 3}; }

/// y = (z - shift) * scale of input j.
GRAUPEL_HD inline double standardised(const MapView& map, int j, double z) { return (z - map.shift[j]) * map.scale[j]; }
/// The same held at the box of the centres.
GRAUPEL_HD inline double held(const MapView& map, int j, double y) {
  if (map.count == 0) return y;
  return y < map.low[j] ? map.low[j] : y > map.high[j] ? map.high[j] : y;
}

// branch -------------------------------------------------------------------------------------------------------------

/// Centres whose kernels a block keeps at once.
inline constexpr int branch_centers = 1024;
struct BranchShared {
  double kernel[branch_centers];
};

GRAUPEL_HD inline double map_input(const ModelView& model, const InstanceView& instance, int j) {
  return j < model.latents ? instance.state->latent[j] : instance.parameters[j - model.latents];
}

/// A warp's output of a map, in full in all lanes; all warps of the block must call it, with any output.
template <typename Block>
GRAUPEL_HD double map_output(const Block& block, const ModelView& model, const InstanceView& instance,
                             const MapView& map, int output, BranchShared& shared) {
  const int lane = block.thread() % warp_width;
  double sum = 0;
  for (int first = 0; first < map.count; first += branch_centers) {
    const int count = map.count - first < branch_centers ? map.count - first : branch_centers;
    block.sync();
    for (int i = block.thread(); i < count; i += block.threads()) {
      double r2 = 0;
      for (int j = 0; j < map.inputs; ++j) {
        const double d = held(map, j, standardised(map, j, map_input(model, instance, j))) -
                         map.centers[int64_t(j) * map.count + first + i];
        r2 += d * d;
      }
      shared.kernel[i] = r2 * std::sqrt(r2);
    }
    block.sync();
    if (output >= map.outputs) continue;
    const double* const weights = map.weights + int64_t(output) * map.count + first;
    for (int i = lane; i < count; i += warp_width) sum += shared.kernel[i] * weights[i];
  }
  sum = sum_of_warp(block, sum);
  if (output >= map.outputs) return 0;
  const double* const linear = map.linear + int64_t(output) * (1 + map.inputs);
  sum += linear[0];
  for (int j = 0; j < map.inputs; ++j) sum += linear[1 + j] * standardised(map, j, map_input(model, instance, j));
  return sum;
}

/// Blocks that the outputs of the two maps take, a warp each.
inline int branch_blocks(const ModelView& model) {
  return (model.stress_map.outputs + step_warps - 1) / step_warps +
         (model.affine_map.outputs + step_warps - 1) / step_warps;
}

/// Position of a particle in all lanes of a warp [m].
template <typename Block>
GRAUPEL_HD Vec<float, 3> decoded_position(const Block& block, const ModelView& model, const InstanceView& instance,
                                          int32_t particle) {
  const int lane = block.thread() % warp_width;
  const float* const modes = model.deformation + int64_t(particle) * 3 * model.deformation_stride;
  Vec<float, 3> x = Vec<float, 3>::zero();
  for (int k = lane; k < model.deformation_modes; k += warp_width) {
    const auto a = static_cast<float>(instance.coefficient[k]);
    for (int c = 0; c < 3; ++c) x[c] += modes[c * model.deformation_stride + k] * a;
  }
  for (int c = 0; c < 3; ++c) x[c] = sum_of_warp(block, x[c]) + model.deformation_mean[3 * int64_t(particle) + c];
  return x;
}

/// Integration points within reach of a marked node. A box of three nodes that meets one of the marked boxes, which
/// are larger, has a corner in it.
template <typename Block>
GRAUPEL_HD void find_points(const Block& block, const ModelView& model, const InstanceView& instance, int first_warp,
                            int warps) {
  const int lane = block.thread() % warp_width;
  for (int p = first_warp; p < model.points; p += warps) {
    const Stencil s = stencil_at(instance, decoded_position(block, model, instance, model.point_particle[p]));
    bool reaches = false;
    if (s.inside && lane < 8) {
      Vec<int, 3> corner = s.base;
      for (int d = 0; d < 3; ++d) corner[d] += 2 * (lane >> d & 1);
      reaches = instance.node_place[node_number(instance.nodes, corner)] >= first_place;
    }
    if (block.ballot(reaches) != 0 && lane == 0)
      instance.point_list[block.add(&instance.state->point_count, int32_t{1})] = p;
  }
}

template <typename Block>
GRAUPEL_HD void branch(const Block& block, const RunView& view, BranchShared& shared) {
  const int per_instance = view.branch_blocks + view.worker_blocks, part = block.index() % per_instance;
  const InstanceView& instance = view.instances[block.index() / per_instance];
  const ModelView& model = view.model;
  if (instance.state->status != RunStatus::running) return;
  const int warp = block.thread() / warp_width;
  if (part >= view.branch_blocks) {
    const int worker = part - view.branch_blocks, threads = view.worker_blocks * block.threads();
    const int64_t sums = int64_t(instance.state->node_count) * mpm::channels;
    for (int64_t i = int64_t(worker) * block.threads() + block.thread(); i < sums; i += threads)
      instance.sums[i] = 0.0f;
    if (instance.state->due != 0)
      find_points(block, model, instance, worker * step_warps + warp, view.worker_blocks * step_warps);
    return;
  }
  const int stress_blocks = (model.stress_map.outputs + step_warps - 1) / step_warps;
  const bool stress = part < stress_blocks;
  const MapView& map = stress ? model.stress_map : model.affine_map;
  const int output = (stress ? part : part - stress_blocks) * step_warps + warp;
  const double value = map_output(block, model, instance, map, output, shared);
  if (output < map.outputs && block.thread() % warp_width == 0)
    instance.map_rows[(stress ? 0 : model.stress_map.outputs) + output] = value;
}

// decode -------------------------------------------------------------------------------------------------------------

struct DecodeShared {
  float deformation[most_deformation_modes], rate[most_deformation_modes];
  float stress[most_field_modes], affine[most_field_modes];  ///< times the modes' scales
  float decoded[step_warps][warp_width];
};

template <typename Block>
GRAUPEL_HD void load_coefficients(const Block& block, const ModelView& model, const InstanceView& instance,
                                  DecodeShared& shared) {
  const int first = block.thread(), step = block.threads(), r = model.latents;
  for (int k = first; k < model.deformation_stride; k += step) {
    const bool real = k < model.deformation_modes;
    shared.deformation[k] = real ? static_cast<float>(instance.coefficient[k]) : 0.0f;
    shared.rate[k] = real ? static_cast<float>(instance.rate[k]) : 0.0f;
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

/// A point's fields, value n in lane n: position 0, velocity 3, stress 6, affine velocity 12.
template <typename Block>
GRAUPEL_HD float decode_point(const Block& block, const ModelView& model, int32_t point, const DecodeShared& shared) {
  const int lane = block.thread() % warp_width;
  const int64_t particle = model.point_particle[point];
  float value[warp_width] = {};
  const float* const deformation = model.deformation + particle * 3 * model.deformation_stride;
  for (int k = lane; k < model.deformation_stride; k += deformation_group) {
    const float a = shared.deformation[k], rate = shared.rate[k];
    GRAUPEL_UNROLL
    for (int c = 0; c < 3; ++c) {
      const float mode = deformation[c * model.deformation_stride + k];
      value[c] += mode * a;
      value[3 + c] += mode * rate;
    }
  }
  // Two modes a lane: 128 bytes a warp.
  const auto add_field = [&](auto components, int at, const uint32_t* rows, int stride, const float* coefficient) {
    const uint32_t* const row = rows + int64_t(point) * decltype(components)::value * (stride / 2);
    for (int k = lane; k < stride / 2; k += warp_width) {
      const float a = coefficient[2 * k], b = coefficient[2 * k + 1];
      GRAUPEL_UNROLL
      for (int c = 0; c < decltype(components)::value; ++c) {
        const uint32_t pair = row[c * (stride / 2) + k];
        value[at + c] += float_of_half(static_cast<uint16_t>(pair)) * a;
        value[at + c] += float_of_half(static_cast<uint16_t>(pair >> 16)) * b;
      }
    }
  };
  add_field(std::integral_constant<int, 6>{}, 6, model.stress, model.stress_stride, shared.stress);
  add_field(std::integral_constant<int, 9>{}, 12, model.affine, model.affine_stride, shared.affine);
  float sum = sums_by_lane(block, lane, value);
  if (lane < 3) sum += model.deformation_mean[3 * particle + lane];
  if (lane >= 6 && lane < decoded_values) sum += model.field_mean[int64_t(point) * field_components + lane - 6];
  return sum;
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
/// (mpm/transfer.h).
template <typename Block>
GRAUPEL_HD void scatter_point(const Block& block, const RunView& view, const InstanceView& instance, int32_t point,
                              const float* decoded) {
  const int lane = block.thread() % warp_width;
  if (lane >= stencil_nodes) return;
  const Vec<float, 3> x = {decoded[0], decoded[1], decoded[2]};
  const Stencil s = stencil_at(instance, x);
  if (!s.inside) return;
  const Vec<int, 3> offset = stencil_node(lane);
  const int32_t place = instance.node_place[node_number(instance.nodes, s.base + offset)];
  if (place < first_place) return;
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
  const mpm::GridGeometry<float, 3>& grid = instance.scene.grid;
  const float mass = instance.point_mass[point];
  const float force = -static_cast<float>(view.dt) * instance.point_volume[point] * 4.0f * grid.inverse_dx;
  const Mat<float, 3> A = C * (mass * grid.dx) + tau * force;
  float w = 1;
  Vec<float, 3> from_point;
  for (int d = 0; d < 3; ++d) {
    from_point[d] = static_cast<float>(offset[d]) - s.fx[d];
    w *= mpm::bspline(from_point[d]);
  }
  add_to_node(block, instance.sums + int64_t(place - first_place) * mpm::channels, w * (mass * v + A * from_point),
              w * mass);
}

template <typename Block>
GRAUPEL_HD void decode(const Block& block, const RunView& view, DecodeShared& shared) {
  const InstanceView& instance = view.instances[block.index() / view.decode_blocks];
  if (instance.state->status != RunStatus::running) return;
  load_coefficients(block, view.model, instance, shared);
  block.sync();
  const int warp = block.thread() / warp_width, lane = block.thread() % warp_width;
  float* const decoded = shared.decoded[warp];
  const int32_t count = instance.state->point_count;
  for (int32_t i = block.index() % view.decode_blocks * step_warps + warp; i < count;
       i += view.decode_blocks * step_warps) {
    const int32_t point = instance.point_list[i];
    decoded[lane] = decode_point(block, view.model, point, shared);
    block.sync_warp();
    scatter_point(block, view, instance, point, decoded);
    block.sync_warp();
  }
}

// gather -------------------------------------------------------------------------------------------------------------

/// Position of a sample before the step, in all lanes [m].
template <typename Block>
GRAUPEL_HD Vec<double, 3> sample_position(const Block& block, const ModelView& model, const InstanceView& instance,
                                          int sample) {
  const int lane = block.thread() % warp_width;
  Vec<double, 3> x = Vec<double, 3>::zero();
  for (int k = lane; k < model.deformation_modes; k += warp_width)
    for (int c = 0; c < 3; ++c)
      x[c] += static_cast<double>(model.sample_modes[int64_t(k) * model.sample_rows + 3 * sample + c]) *
              instance.coefficient[k];
  for (int c = 0; c < 3; ++c) x[c] = sum_of_warp(block, x[c]) + model.sample_mean[3 * sample + c];
  return x;
}

/// Velocity after gravity and contact at a node of the grid with these sums; zero without mass.
GRAUPEL_HD inline Vec<float, 3> node_velocity(const RunView& view, const InstanceView& instance, const Vec<int, 3>& at,
                                              const float* sums) {
  const mpm::SceneView<float>& scene = instance.scene;
  const float mass = sums[3];
  if (!(mass > 0.0f)) return Vec<float, 3>::zero();
  Vec<float, 3> v =
      Vec<float, 3>{sums[0], sums[1], sums[2]} * (1.0f / mass) + static_cast<float>(view.dt) * scene.gravity;
  Vec<int, 3> block;
  int inside = 0;
  for (int d = 0; d < 3; ++d) {
    block[d] = at[d] / mpm::block_width;
    inside = inside * mpm::block_width + at[d] % mpm::block_width;
  }
  const Vec<float, 3> x = scene.grid.node_position(at);
  const int32_t key = scene.grid.directory_index(block);
  const mpm::MovingObstacleView<float> moving = instance.moving(instance.state->step);
  v = moving.count > 0 ? mpm::meet_obstacles<true, 3, float>(scene, moving, key, inside, x, v)
                       : mpm::meet_obstacles<false, 3, float>(scene, moving, key, inside, x, v);
  return mpm::meet_walls(scene.walls, x, scene.grid.dx, v);
}

/// Where a sample goes with velocity v, kept inside the walls and out of obstacles as mpm/move_particles.cpp does. The
/// way [m] is not rounded to the precision of positions where nothing is in the way: that would count in velocities.
GRAUPEL_HD inline Vec<float, 3> sample_way(const RunView& view, const InstanceView& instance, bool led,
                                           const Vec<double, 3>& before, const Vec<float, 3>& v) {
  const mpm::SceneView<float>& scene = instance.scene;
  const auto dt = static_cast<float>(view.dt);
  const Vec<float, 3> from = before.cast<float>(), step = dt * v, wanted = from + step;
  Vec<float, 3> x = wanted;
  for (int d = 0; d < 3; ++d) {
    x[d] = x[d] < scene.walls.particle_low[d] ? scene.walls.particle_low[d] : x[d];
    x[d] = x[d] > scene.walls.particle_high[d] ? scene.walls.particle_high[d] : x[d];
  }
  Vec<float, 3> surface = Vec<float, 3>::zero();
  if (!led && scene.push_out) {
    const mpm::MovingObstacleView<float> moving = instance.moving(instance.state->step);
    if (moving.count > 0 && mpm::near_moving(moving, x))
      surface = mpm::push_out_of_moving<3>(scene, moving, dt, from, x);
    else if (mpm::near_surface<3, float>(scene, x))
      sparsegrid::push_out<3>(scene.obstacle_nodes.obstacles, scene.walls.particle_low, scene.walls.particle_high, from,
                              x);
  }
  Vec<float, 3> slowed = v;
  if (!led && !(x == wanted)) {
    mpm::Survey unused;
    mpm::stop_at_surface(x - wanted, 1.0f, surface, slowed, unused);
  }
  Vec<float, 3> way = step;
  for (int d = 0; d < 3; ++d)
    if (!(x[d] == wanted[d] && slowed[d] == v[d])) way[d] = static_cast<float>(static_cast<double>(x[d]) - before[d]);
  return way;
}

template <typename Block>
GRAUPEL_HD void gather_sample(const Block& block, const RunView& view, const InstanceView& instance, int sample) {
  const int lane = block.thread() % warp_width;
  const Vec<double, 3> before = sample_position(block, view.model, instance, sample);
  const Stencil s = stencil_at(instance, before.cast<float>());
  Vec<float, 3> v = Vec<float, 3>::zero();
  if (s.inside && lane < stencil_nodes) {
    const Vec<int, 3> offset = stencil_node(lane), at = s.base + offset;
    const int32_t place = instance.node_place[node_number(instance.nodes, at)];
    float w = 1;
    for (int d = 0; d < 3; ++d) w *= mpm::bspline(static_cast<float>(offset[d]) - s.fx[d]);
    if (place >= first_place)
      v = w * node_velocity(view, instance, at, instance.sums + int64_t(place - first_place) * mpm::channels);
  }
  for (int d = 0; d < 3; ++d) v[d] = sum_of_warp(block, v[d]);
  if (lane != 0) return;
  const mpm::RigidStep<float>* const leader =
      instance.sample_script == nullptr ? nullptr
                                        : instance.leader(instance.sample_script[sample], instance.state->step);
  if (leader != nullptr) v = leader->velocity_at(before.cast<float>());
  const bool still = leader == nullptr && instance.sample_still[sample] != 0;
  bool fits = s.inside;
  for (int d = 0; d < 3; ++d) fits = fits && std::abs(static_cast<float>(view.dt) * v[d]) <= instance.scene.grid.dx;
  const Vec<float, 3> way =
      !fits || still ? Vec<float, 3>::zero() : sample_way(view, instance, leader != nullptr, before, v);
  for (int d = 0; d < 3; ++d) instance.way[3 * sample + d] = way[d];
  instance.lost[sample] = fits || still ? 0 : 1;
}

template <typename Block>
GRAUPEL_HD void gather(const Block& block, const RunView& view) {
  const InstanceView& instance = view.instances[block.index() / view.gather_blocks];
  if (instance.state->status != RunStatus::running) return;
  for (int sample = block.index() % view.gather_blocks * step_warps + block.thread() / warp_width;
       sample < view.model.samples; sample += view.gather_blocks * step_warps)
    gather_sample(block, view, instance, sample);
}

// frames -------------------------------------------------------------------------------------------------------------

/// Position and velocity of all particles of an instance, [particles, 6].
template <typename Block>
GRAUPEL_HD void write_frame(const Block& block, const RunView& view, int number, float* frame) {
  const InstanceView& instance = view.instances[number];
  const ModelView& model = view.model;
  const int lane = block.thread() % warp_width, warps = block.blocks() * step_warps;
  for (int32_t p = block.index() * step_warps + block.thread() / warp_width; p < model.particles; p += warps) {
    float value[warp_width] = {};
    const float* const modes = model.deformation + int64_t(p) * 3 * model.deformation_stride;
    for (int k = lane; k < model.deformation_modes; k += warp_width) {
      const auto a = static_cast<float>(instance.coefficient[k]), rate = static_cast<float>(instance.rate[k]);
      for (int c = 0; c < 3; ++c) {
        const float mode = modes[c * model.deformation_stride + k];
        value[c] += mode * a;
        value[3 + c] += mode * rate;
      }
    }
    const float sum = sums_by_lane(block, lane, value);
    if (lane < 6)
      frame[6 * int64_t(p) + lane] = sum + (lane < 3 ? model.deformation_mean[3 * int64_t(p) + lane] : 0.0f);
  }
}

}  // namespace graupel::rom::device
