// Coarse MPM with trained constants: the scene on a grid of `resolution` times its spacing, with effective constants
// and a step of its own. A run of it is a run of the solver, so contact, momentum and conservation are the solver's.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "hybrid/effective_constants.h"
#include "nn/weights.h"

namespace graupel::hybrid {

inline constexpr const char* coarse_architecture = "coarse_mpm";

/// Lowest and highest value of each constant in the training scenes, by "law.key" ("sand.friction_angle"), and
/// "contact.friction", "contact.kinds" (of Contact, 0 to 2).
using TrainedRanges = std::map<std::string, std::pair<double, double>>;
/// Widens the ranges to hold a scene's constants.
void widen(TrainedRanges& ranges, const Scene& scene);

struct CoarseModel {
  double resolution = 1.5;  ///< grid spacing over the scene's, from 1
  EffectiveConstants constants;
  /// ln of the Courant numbers that set the step: c dt / dx of a law's elastic waves at rest, and v dt / dx of the
  /// largest speed that the scene can be expected to have.
  std::map<MaterialModel, double> log_courant;
  double log_speed_courant;
  TrainedRanges ranges;                         ///< empty: not told
  std::map<std::string, std::string> metadata;  ///< of the file: provenance

  CoarseModel();
  /// Everything that training changes, by name, in a fixed order.
  static const std::vector<std::string>& parameter_names();
  std::vector<double> parameters() const;
  void set_parameters(const std::vector<double>& values);

  /// What the solver runs: coarse grid, effective constants, fixed steps.
  Scene scene(const Scene& of) const;
  /// Substeps a frame of such a scene.
  int64_t substeps(const Scene& coarse) const;
  /// A line for each constant and contact of the scene outside the training's range.
  std::vector<std::string> unlike_training(const Scene& scene) const;

  nn::Weights store() const;
  /// Throws InputError for a file of another kind, version or with numbers out of range.
  static CoarseModel load(const nn::Weights& weights);
};

/// Whether the file holds such a model; false where it cannot be read.
bool is_coarse_model(const nn::Weights& weights);

}  // namespace graupel::hybrid
