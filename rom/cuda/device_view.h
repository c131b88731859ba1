// What the kernels of a reduced-order model's step read and write (rom/cuda/device_step.h): the model's tables, which
// all instances share, and each instance's scene, grid and latent state.
#pragma once

#include <cstdint>

#include "core/parallel/thread_block.h"
#include "mpm/grid/moving_obstacles.h"
#include "mpm/grid/scene_view.h"
#include "mpm/particles/particle_lifecycle.h"

namespace graupel::rom::device {

inline constexpr int most_latents = 32;
inline constexpr int most_closure_latents = 16;  ///< of models with coefficient maps, whose slopes are in registers
inline constexpr int most_deformation_modes = 96, most_field_modes = 256;
inline constexpr int deformation_group = 32;  ///< modes are padded to this: one f32 a lane
inline constexpr int field_group = 32;        ///< of stress and affine velocity: two f16 a lane of half a warp
inline constexpr int stress_pairs = 3, affine_pairs = 5;  ///< of components, that a warp reads at once
inline constexpr int field_components = 15;               ///< stress xx, yy, zz, xy, xz, yz; affine velocity row by row
inline constexpr int mode_components = 12;                ///< of a deformation alone: u, then du/dX row by row
inline constexpr int step_threads = 256;

/// A coefficient map (rom/fields/coefficient_map.h).
struct MapView {
  int inputs, outputs, count;
  const double *shift, *scale, *low, *high;  ///< [inputs]
  const double* centers;                     ///< standardised [inputs, count]
  const double* weights;                     ///< [outputs, count]
  const double* linear;                      ///< [outputs, 1 + inputs]
};

struct ModelView {
  int latents, particles, points, samples;
  int deformation_modes, stress_modes, affine_modes;
  int deformation_stride, stress_stride, affine_stride;  ///< modes with their padding
  const float* deformation;                              ///< [particles, 3, stride]
  const float* deformation_mean;                         ///< [particles, 3] [m]
  /// Pairs of f16 over the scale [points, groups of modes, 6 or 10 components, group / 2].
  const uint32_t *stress, *affine;
  const float *stress_scale, *affine_scale;  ///< [stride]
  const float* field_mean;                   ///< [points, 15]
  const int32_t* point_particle;             ///< [points] integration points in the body
  MapView closure, stress_map, affine_map;
  bool affine_is_rate;        ///< the map gives rows of M(q, mu) with l = M q'
  int sample_rows;            ///< 3 samples, with padding
  const float* sample_modes;  ///< [deformation modes, sample_rows]
  const double* sample_mean;  ///< [3 samples] [m]
  /// U^T U, U the modes at the samples, [deformation modes, deformation modes].
  const double* gram;

  // Models of the deformation alone (rom/cuda/device_elastic.h): a mode a latent, with coefficients q - q0; no maps.
  bool deformation_alone;
  /// [groups of 32 points, modes, 12, 32] u_k [m] and du_k/dX, of lanes' points; X [m] [groups, 3, 32].
  const float *point_modes, *point_reference;
  const double* inverse;  ///< (U^T U)^-1 [modes, modes], of samples that all have weight 1
  double condition;       ///< largest pivot of U^T U over the smallest
  GRAUPEL_HD int point_groups() const { return (points + warp_width - 1) / warp_width; }
};

enum class RunStatus : int32_t {
  running,
  samples_lost,  ///< more than half of the samples moved over one cell or are not finite
  singular       ///< the normal equations are singular or not finite
};

/// What a step leaves of an instance, beside its arrays; copied by words of eight bytes.
struct alignas(8) InstanceState {
  double latent[most_latents], velocity[most_latents];
  double moved;               ///< since blocks were marked [m]
  double residual;            ///< largest of the frame, over the samples' way
  double down_weighted;       ///< shares of samples, summed over the frame
  double condition;           ///< largest of the run
  int64_t points_sum, steps;  ///< of the run
  RunStatus status;
  int32_t step;                      ///< of the frame
  int32_t due;                       ///< blocks are to be marked anew, and points found
  int32_t round;                     ///< of marking
  int32_t block_count, point_count;  ///< marked blocks of nodes; integration points in reach of them
  int32_t most_points;
  int32_t group_count;  ///< groups of points with some of these, of a deformation alone
};

/// What a step's fit needs of the samples that are not lost.
struct alignas(8) WaySums {
  double projection[most_deformation_modes];  ///< U^T way
  double moved2;                              ///< sum of the squares of the ways [m^2]
  int32_t furthest;                           ///< bits of the longest way's square, a float
  int32_t lost;                               ///< samples

  // Of a deformation alone, whose samples have weights w; `projection` is then U^T W way.
  double weight, weighted2;  ///< sums of w, and of w times the square of the way
  int32_t weighed;           ///< samples with another weight than 1
  int32_t arrived;           ///< blocks of samples that are done
};

/// The least-squares problem of a step's fit, solved for any U^T way (rom/cuda/device_fit.h): dq = P (U^T way) - p.
struct alignas(8) NormalEquations {
  double solution[most_closure_latents * most_deformation_modes];  ///< P = M^-1 S^T [r, modes]
  double offset[most_closure_latents];                             ///< p = M^-1 S^T G d, d = a(q*) - a_0
  double turned[most_closure_latents];                             ///< S^T G d
  double matrix[most_closure_latents * most_closure_latents];      ///< M = S^T G S
  double square;                                                   ///< d^T G d
  double condition;                                                ///< largest pivot of M over the smallest
  int64_t solved;                                                  ///< 0: M is singular or not finite
};

struct InstanceView {
  mpm::SceneView<float> scene;
  int32_t step_count;  ///< of a frame
  int32_t moving_count, obstacle_count, script_count;
  const int32_t* moving_index;                                ///< [moving_count]
  const sparsegrid::ObstacleView *moving_start, *moving_end;  ///< poses [steps of a frame, obstacles]
  const mpm::RigidStep<float>* moving_step;                   ///< [steps, obstacles]
  const mpm::ScriptStep<float>* scripts;                      ///< [steps, scripts]
  const float *point_mass, *point_volume;                     ///< [points] [kg], [m^3]
  const int32_t *point_script, *sample_script;                ///< -1: none; null: no particle has one
  const uint8_t* sample_still;                                ///< [samples] of a stationary material
  const double* parameters;
  long long* block_mark;  ///< [blocks of nodes] the round in which it was last marked and, below, its place in the sums
  float* sums;            ///< [marked blocks, nodes of a block, 4] momentum [kg m/s], mass [kg]
  uint8_t* point_taken;   ///< [points] whether it is in reach of a marked block
  double* map_rows;       ///< outputs of stress_map, then of affine_map
  double *coefficient, *earlier;  ///< of the deformation's modes, and a step earlier [deformation modes]
  double* rate;                   ///< their change in time, at the start and after a step
  double *ahead, *slope;          ///< coefficients where the velocity takes q, and da/dq there [deformation modes, r]
  double* reached;                ///< coefficients after the step, to first order
  const double* curve;            ///< where runs go at the instance's parameters [curve_points, r]
  int32_t curve_points;           ///< 0: none
  double* gram;                   ///< room for G of some of the samples
  NormalEquations* equations;
  WaySums* ways;
  uint8_t* lost;  ///< [samples]
  InstanceState* state;

  // Of a deformation alone.
  const int32_t* point_material;  ///< [points]
  int32_t* groups;                ///< [groups of points] numbers of those with a point in reach of a marked block
  uint32_t* group_points;         ///< [groups of points] bit l: the point of lane l is in such reach
  float* weight;                  ///< [samples]
  int32_t* weighed;               ///< [samples] those with another weight than 1

  /// A step of the frame; beyond it, where kernels are timed alone, its last one.
  GRAUPEL_HD int64_t known_step(int step) const { return step < step_count ? step : step_count - 1; }
  GRAUPEL_HD mpm::MovingObstacleView<float> moving(int step) const {
    const int64_t first = known_step(step) * obstacle_count;
    return {moving_count,
            moving_index,
            {moving_start + first, obstacle_count},
            {moving_end + first, obstacle_count},
            moving_step + first};
  }
  /// The motion that leads a particle with this script, or null.
  GRAUPEL_HD const mpm::RigidStep<float>* leader(int32_t script, int step) const {
    if (script < 0) return nullptr;
    const mpm::ScriptStep<float>& s = scripts[known_step(step) * script_count + script];
    return s.leads ? &s.motion : nullptr;
  }
};

struct RunView {
  ModelView model;
  const InstanceView* instances;
  int instance_count;
  double dt;             ///< [s]
  double pull;           ///< share of the way to the curve that a step takes
  double curve_step;     ///< parts of the curve that a step is
  float contact_weight;  ///< of samples of a deformation alone that a moving obstacle pushes
  int worker_blocks;     ///< of an instance: for clearing and marking nodes
  int decode_blocks, gather_blocks;
};

}  // namespace graupel::rom::device
