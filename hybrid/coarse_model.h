// Coarse MPM with trained constants: softer matter takes longer steps, and what that saves is spent on the finest grid
// that is predicted to cost no more than MPM on 2 dx. A run of it is a run of the solver, so contact, momentum and
// conservation are the solver's.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "hybrid/effective_constants.h"
#include "nn/trained_box.h"
#include "nn/weights.h"

namespace graupel::hybrid {

inline constexpr const char* coarse_architecture = "coarse_mpm";

/// ln of the Courant numbers that set a step: c dt / dx of a law's elastic waves at rest, and v dt / dx of the largest
/// speed that the scene can be expected to have.
struct CourantNumbers {
  CourantNumbers();
  std::map<MaterialModel, double> waves;
  double speed;
  /// Waves count as at least this fast [m/s], by law: soft snow and jelly deform until they are stiff, and need as many
  /// substeps as stiff ones. Not trained: see CoarseModel.
  std::map<MaterialModel, double> least_speed = {{MaterialModel::snow, 26}, {MaterialModel::jelly, 22}};
};

/// A frame of N substeps with p times the particles a cell on a grid of spacing r dx takes a time in proportion to
/// (N + frame) p^share r^-spacing.
struct FrameCost {
  double frame = 0;               ///< what a frame takes besides its substeps, in substeps: particles are put in order
  double share = 0, spacing = 0;  ///< exponents
};

/// Training searches for `constants` and fits `log_courant`, but for `least_speed`, and `log_opponent`. The rest are
/// rules: by default safety factors, least speeds, particle shares and finest spacings of
/// models/coarse-mpm.safetensors, chosen by hand on 57 scenes of split train (docs/lab/coarse-mpm.md, "Where the error
/// comes from").
struct CoarseModel {
  EffectiveConstants constants;
  CourantNumbers log_courant;
  /// ln of the substeps of the model's own runs over those that log_courant asks for, by law: as many as the largest
  /// stable step may leave larger errors (docs/lab/coarse-mpm.md).
  std::map<MaterialModel, double> log_safety = {{MaterialModel::water, 0.4},
                                                {MaterialModel::sand, 0.15},
                                                {MaterialModel::snow, 0.15},
                                                {MaterialModel::jelly, -0.4}};
  /// ln of the substeps that the search for the largest step finds in the mean on 2 dx over those that log_courant asks
  /// for, by law: log_courant is fitted to be rarely too few.
  std::map<MaterialModel, double> log_opponent;
  /// Grid spacings over the scene's that the model chooses from, ascending from 1; the last one where all cost too
  /// much.
  std::vector<double> resolutions = {1, 1.125, 1.25, 1.375, 1.5, 1.625, 1.75, 1.875, 2, 2.125, 2.25};
  /// The finest of them that it chooses, by law, the least of the scene's: on finer grids, with the few substeps that
  /// softer matter takes, water alone keeps more of its motion than on the scene's own grid (docs/lab/coarse-mpm.md).
  std::map<MaterialModel, double> finest = {{MaterialModel::water, 1.875}};
  /// Particles a cell over the scene's, by law, the least of the scene's; at its own spacing its own are moved. Half of
  /// them buy a finer grid, but water errs more with fewer.
  std::map<MaterialModel, double> particle_share = {
      {MaterialModel::water, 1.5}, {MaterialModel::sand, 0.5}, {MaterialModel::snow, 0.5}, {MaterialModel::jelly, 0.5}};
  /// On a GPU the time of a substep of a small scene hardly depends on its particles.
  std::map<Device, FrameCost> frame_cost = {{Device::cpu, {3.5, 0.7, 2.4}}, {Device::cuda, {0, 0.25, 0.75}}};
  nn::TrainedBox trained;                       ///< empty: not told
  std::map<std::string, std::string> metadata;  ///< of the file: provenance

  /// The constants that the search changes, by name, in a fixed order.
  static const std::vector<std::string>& parameter_names();
  std::vector<double> parameters() const;
  void set_parameters(const std::vector<double>& values);

  /// What the solver runs: coarse grid, effective constants, steps by waves, more in frames of fast particles.
  Scene scene(const Scene& of, double resolution) const;
  /// Particles a cell over the scene's on a grid of that spacing.
  double share(const Scene& scene, double resolution) const;
  /// The finest of `resolutions`, not beyond `finest`, whose predicted time is at most that of the scene's own
  /// constants on 2 dx.
  double resolution(const Scene& of, Device device) const;
  /// Predicted time of such a run over that of MPM on 2 dx at its largest stable step.
  double cost(const Scene& of, double resolution, Device device) const;
  /// The same where that step is known.
  double cost(const Scene& of, double resolution, Device device, int64_t opponent_substeps) const;
  /// Substeps a frame that the search for the largest step is expected to find on 2 dx.
  int64_t opponent_substeps(const Scene& of) const;
  /// Substeps a frame of the largest stable step of a scene on any grid, as predicted from its waves and the fall
  /// through its domain.
  int64_t largest_step_substeps(const Scene& scene) const;
  /// Least substeps a frame of the model's own run of a scene, by its waves.
  int64_t wave_substeps(const Scene& scene) const;
  /// A line for each constant and contact of the scene outside the training's range.
  std::vector<std::string> unlike_training(const Scene& scene) const;

  nn::Weights store() const;
  /// Throws InputError for a file of another kind, version or with numbers out of range.
  static CoarseModel load(const nn::Weights& weights);
};

/// Whether the file holds such a model.
bool is_coarse_model(const nn::Weights& weights);

}  // namespace graupel::hybrid
