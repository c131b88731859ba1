// A reduced-order model and its runs as plain arrays, from which a device's are filled (rom/cuda/device_run.h): what
// nvcc compiles sees neither Eigen nor the classes of the fields.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mpm/simulation.h"
#include "rom/cuda/device_view.h"

namespace graupel::rom {

struct LatentState;
struct ReducedModel;
struct ReducedOptions;

namespace device {

/// A coefficient map, as MapView has it.
struct MapTable {
  int inputs = 0, outputs = 0, count = 0;
  std::vector<double> shift, scale, low, high, centers, weights, linear;
};

/// Meanings and shapes as in ModelView.
struct ModelTable {
  int latents = 0;
  int deformation_modes = 0, stress_modes = 0, affine_modes = 0;
  std::vector<float> deformation, deformation_mean, stress_scale, affine_scale, field_mean, sample_modes;
  std::vector<uint32_t> stress, affine;
  std::vector<int32_t> point_particle, samples;
  std::vector<double> sample_mean, gram;
  MapTable closure, stress_map, affine_map;
  bool affine_is_rate = false;
  std::vector<float> point_modes, point_reference;  ///< of a deformation alone, which has no maps
  std::vector<double> inverse;
  double condition = 0;

  bool deformation_alone() const { return !point_modes.empty(); }
  int particles() const { return static_cast<int>(deformation_mean.size() / 3); }
  int points() const { return static_cast<int>(point_particle.size()); }
};

/// One run: its scene and where it starts.
struct InstanceTable {
  mpm::PreparedScene prepared;
  std::vector<double> parameters, latent, velocity;  ///< mu, q, q'
  std::vector<double> coefficient, rate;  ///< of the deformation's modes at the start, and their change [1/s]
  std::vector<double> point_weight;       ///< [points] mass and volume over the particle's own
  std::vector<double> curve;              ///< where runs go at these parameters [n, latents]; may be empty
};

/// Throws ConfigError for a model whose fields no kernel knows (networks), or that is too large for them.
ModelTable model_table(const ReducedModel& model, const std::vector<int32_t>& samples);
/// Throws ConfigError for a scene with what no kernel knows: a plane, cubic splines, periodic walls, particles that
/// come or go.
void check_scene(const Scene& scene);
/// `state` is that of the scene's start.
InstanceTable instance_table(const ReducedModel& model, mpm::PreparedScene prepared, const LatentState& state);
/// Throws ConfigError for what no kernel does. NSF: more than one iteration, other projections, manifold_pull with more
/// than one parameter. A deformation alone: integrated gradients, manifold_pull. Both: Eulerian quadrature.
void check_options(const ReducedModel& model, const ReducedOptions& options);

}  // namespace device
}  // namespace graupel::rom
