// A reduced-order model as a weights file keeps it: fields, samples and quadrature, the scene that it was trained on
// with the parameters that may change, and what it needs to judge itself.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/fields.h"
#include "nn/weights.h"
#include "rom/cubature/quadrature.h"
#include "rom/fields/fields.h"
#include "rom/interpolation_bound.h"
#include "rom/networks/conv_encoder.h"
#include "rom/projection/projection.h"
#include "rom/solver/error_indicator.h"
#include "rom/solver/quadrature.h"

namespace graupel::rom {

/// What the affine velocity is a function of.
enum class AffineKind {
  rate,     ///< M(q, mu) q': it follows the velocity
  position  ///< l(q, mu), as in the paper
};

constexpr auto enum_list(AffineKind) {
  return std::to_array<std::pair<const char*, AffineKind>>(
      {{"rate", AffineKind::rate}, {"position", AffineKind::position}});
}

/// What a model knows; `architecture` in the metadata of a weights file.
enum class ReducedKind {
  nsf,  ///< deformation, stress and affine velocity (Neural Stress Fields)
  crom  ///< the deformation alone: stress follows from its gradient
};

constexpr auto enum_list(ReducedKind) {
  return std::to_array<std::pair<const char*, ReducedKind>>({{"nsf", ReducedKind::nsf}, {"crom", ReducedKind::crom}});
}

/// Whether weights are a reduced-order model's, of any kind.
bool is_reduced_model(const nn::Weights& weights);

/// A key of the scene that differs from run to run.
struct ModelParameter {
  std::string name, unit;
  std::vector<std::string>
      keys;                  ///< of the scene that follow it: "materials.sand.friction_angle"; the first has its value
  double low = 0, high = 0;  ///< of the training runs
};

struct ReducedModel {
  ReducedKind kind = ReducedKind::nsf;
  std::string scene_json;  ///< of a training run
  std::vector<ModelParameter> parameters;
  int64_t substeps_per_frame = 1;  ///< of the training runs
  double frame_time = 0;           ///< [s]
  AffineKind affine_kind = AffineKind::rate;
  std::shared_ptr<const Fields> fields;
  std::vector<float> reference;  ///< X, [particles, 3] [m]
  std::vector<int32_t> samples;  ///< by default
  double manifold_pull = 0;      ///< share of the way back to the training's sheet that a step takes
  double step_factor = 1;        ///< steps over those of the training, by default
  double contact_weight = 1;     ///< in the projection, of samples that a moving obstacle pushes; others have 1
  ProjectionKind projection = ProjectionKind::position;    ///< by default
  QuadratureKind quadrature = QuadratureKind::lagrangian;  ///< by default
  GradientKind gradient = GradientKind::map;               ///< what stress comes from
  Clusters clusters;                        ///< integration points; as many as particles: these themselves
  std::vector<int32_t> encoder;             ///< particles whose positions give the latent, by least squares
  std::optional<ConvEncoder> conv_encoder;  ///< the paper's, which then gives the latent instead
  std::vector<double> start_latent;         ///< mean over the training runs [r]; CROM: of the reference body
  /// Latents of the training snapshots [n, r], the scale of each axis [r], and the largest distance of a held-out
  /// training run to the others in that scale: beyond it a state is unlike those of the training.
  std::vector<float> training_latents;
  std::vector<int32_t> training_run;  ///< that each belongs to [n], ascending; empty in files without
  std::vector<float> run_parameters;  ///< of every training run [runs, parameters]; empty in files without
  std::vector<float> latent_scale;
  double latent_reach = 0;
  TrustLevels usual;       ///< of every frame in roll-outs of training runs
  double usual_error = 0;  ///< largest displacement-relative error of these, over all frames of a run
  std::optional<InterpolationErrors> interpolation;  ///< of the training runs; none where they cannot be interpolated
  /// Singular values of the snapshots of each field ("deformation", "stress", "affine"), falling.
  std::map<std::string, std::vector<float>> singular_values;
  std::map<std::string, std::string> provenance;  ///< data set, command, errors; kept as it is

  int latents() const { return fields->latents(); }
  /// All integration points with the particles that they stand for, from the particles' volumes [m^3].
  GridParticles integration_points(const std::vector<double>& volume) const;
  /// Takes clusters instead of the particles as integration points. Throws ConfigError when it has clusters already.
  void take_clusters(Clusters made);

  /// Throws InputError for a file that is no reduced-order model, or damaged.
  static ReducedModel load(const nn::Weights& weights);
  /// `modes`: how the modes are stored, f32 or f16.
  nn::Weights store(nn::DType modes) const;
};

/// Length of a change of latents, in the model's scale.
double scaled_norm(const ReducedModel& model, const std::vector<double>& change);
/// Largest scaled_norm() of the latents' rates between snapshots of a training run [1/s]; 0 where the file does not
/// tell.
double fastest_of_training(const ReducedModel& model);
/// Distance of a latent to the nearest of the training, in the model's scale.
double latent_distance(const ReducedModel& model, const std::vector<double>& latent);

}  // namespace graupel::rom
