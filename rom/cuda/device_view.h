// What the kernels of a reduced-order model's step read and write (rom/cuda/device_step.h, rom/cuda/device_fit.h): the
// model's tables, which all instances share, and each instance's scene, grid and latent state.
#pragma once

#include <cstdint>

#include "mpm/moving_obstacles.h"
#include "mpm/particle_roles.h"
#include "mpm/scene_view.h"

namespace graupel::rom::device {

inline constexpr int most_latents = 16;
inline constexpr int most_deformation_modes = 128, most_field_modes = 256;
inline constexpr int deformation_group = 32;  ///< modes are padded to this: one f32 a lane
inline constexpr int field_group = 64;        ///< of stress and affine velocity: two f16 a lane
inline constexpr int field_components = 15;   ///< stress xx, yy, zz, xy, xz, yz; affine velocity row by row
inline constexpr int step_threads = 256, fit_threads = 384;

/// A coefficient map (rom/coefficient_map.h). The kernels read `weights` as [outputs, count], but those of the
/// deformation's closure as [count, outputs].
struct MapView {
  int inputs, outputs, count;
  const double *shift, *scale, *low, *high;  ///< [inputs]
  const double* centers;                     ///< standardised [inputs, count]
  const double* weights;
  const double* linear;  ///< [outputs, 1 + inputs]
};

struct ModelView {
  int latents, particles, points, samples;
  int deformation_modes, stress_modes, affine_modes;
  int deformation_stride, stress_stride, affine_stride;  ///< modes with their padding
  const float* deformation;                              ///< [particles, 3, stride]
  const float* deformation_mean;                         ///< [particles, 3] [m]
  const uint32_t *stress, *affine;                       ///< pairs of f16 over the scale [points, 6 or 9, stride / 2]
  const float *stress_scale, *affine_scale;              ///< [stride]
  const float* field_mean;                               ///< [points, 15]
  const int32_t* point_particle;                         ///< [points] integration points in the body
  MapView closure, stress_map, affine_map;
  bool affine_is_rate;        ///< the map gives rows of M(q, mu) with l = M q'
  int sample_rows;            ///< 3 samples, with padding
  const float* sample_modes;  ///< [deformation modes, sample_rows]
  const double* sample_mean;  ///< [3 samples] [m]
  /// U^T U, U the modes at the samples, [deformation modes, deformation modes].
  const double* gram;
};

enum class RunStatus : int32_t {
  running,
  samples_lost,  ///< more than half of the samples moved over one cell or are not finite
  singular       ///< the normal equations are singular or not finite
};

/// What a step leaves of an instance, beside its arrays.
struct InstanceState {
  double latent[most_latents], velocity[most_latents];
  double moved;                           ///< since the integration points were found [m]
  double residual;                        ///< largest of the frame, over the samples' way
  double down_weighted;                   ///< shares of samples, summed over the frame
  double condition;                       ///< largest of the run
  int64_t iterations, points_sum, steps;  ///< of the run
  RunStatus status;
  int32_t step;                     ///< of the frame
  int32_t due;                      ///< nodes were marked anew: points are to be found
  int32_t node_count, point_count;  ///< marked nodes; integration points in reach of them
  int32_t most_points;
};

struct InstanceView {
  mpm::SceneView<float> scene;
  int32_t moving_count, obstacle_count, script_count;
  const int32_t* moving_index;                                ///< [moving_count]
  const sparsegrid::ObstacleView *moving_start, *moving_end;  ///< poses [steps of a frame, obstacles]
  const mpm::RigidStep<float>* moving_step;                   ///< [steps, obstacles]
  const mpm::ScriptStep<float>* scripts;                      ///< [steps, scripts]
  const float *point_mass, *point_volume;                     ///< [points] [kg], [m^3]
  const int32_t *point_script, *sample_script;                ///< -1: none; null: no particle has one
  const uint8_t* sample_still;                                ///< [samples] of a stationary material
  const double* parameters;
  Vec<int, 3> nodes;           ///< of the grid
  int32_t* node_place;         ///< [nodes] 0: not marked; else place + first_place
  int32_t* node_list;          ///< [marked nodes]
  float* sums;                 ///< [marked nodes, 4] momentum [kg m/s], mass [kg]
  int32_t* point_list;         ///< [points] those in reach
  double* map_rows;            ///< outputs of stress_map, then of affine_map
  double *coefficient, *rate;  ///< of the deformation's modes, and their change in time [deformation modes]
  float* way;                  ///< [samples, 3] over the step [m]
  uint8_t* lost;               ///< [samples]
  InstanceState* state;

  GRAUPEL_HD mpm::MovingObstacleView<float> moving(int step) const {
    const int64_t first = int64_t(step) * obstacle_count;
    return {moving_count,
            moving_index,
            {moving_start + first, obstacle_count},
            {moving_end + first, obstacle_count},
            moving_step + first};
  }
  /// The motion that leads a particle with this script, or null.
  GRAUPEL_HD const mpm::RigidStep<float>* leader(int32_t script, int step) const {
    if (script < 0) return nullptr;
    const mpm::ScriptStep<float>& s = scripts[int64_t(step) * script_count + script];
    return s.leads ? &s.motion : nullptr;
  }
};

/// Of a marked node in `node_place`; 1 is a node that is being marked.
inline constexpr int32_t first_place = 2;

struct FitView {
  int iterations;
  double outlier_factor, tolerance;
  bool linearise_always;
};

struct RunView {
  ModelView model;
  const InstanceView* instances;
  int instance_count;
  double dt;  ///< [s]
  FitView fit;
  int branch_blocks, worker_blocks;  ///< of an instance: for rows of the maps, and for clearing and finding points
  int decode_blocks, gather_blocks;
  int team;  ///< blocks that fit one instance together
};

}  // namespace graupel::rom::device
