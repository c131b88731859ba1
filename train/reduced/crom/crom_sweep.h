// What a network of the deformation alone (CROM) is taught of a sweep: displacements, deformation gradients and mean
// velocities to the next frame of all particles and snapshots, standardised, with the latents and their rates.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "rom/networks/mlp.h"
#include "train/config/crom_config.h"
#include "train/reduced/mlp/mlp_module.h"
#include "train/reduced/sweep_snapshots.h"

namespace graupel::train {

class CromSweep {
 public:
  /// `data`: folder of the data set; its train.h5 is read. `config` must outlive this. Throws InputError as
  /// SnapshotSet, ConfigError when the snapshots have fewer modes than there are latents, and as
  /// rom::check_deformation_scene.
  CromSweep(const std::string& data, const CromConfig& config);

  const SweepSnapshots& snapshots() const { return snapshots_; }
  /// Coefficients of the positions' first modes, [snapshots, r]. The modes are those of at most about 1,000 snapshots,
  /// spread over all; each coefficient has about a mean of 0 and a mean square of 1.
  const Eigen::MatrixXd& latents() const { return latents_; }
  /// Those of other snapshots of the same particles, by least squares.
  Eigen::MatrixXd latents_of(const SnapshotSet& set) const;
  /// Root of the share of squares that the latents' modes leave out.
  double latent_tail() const { return modes_.tail(modes_.modes()); }

  /// The network with its data, on the device.
  MlpModule module(Device device, NumberType number = NumberType::f32);
  /// Displacement u(X, q) [m] with such weights.
  rom::Mlp network(const nn::Weights& weights) const;
  /// All of the model but its fields.
  void describe(rom::ReducedModel& model) const;

 private:
  MlpShape shape() const;
  std::vector<float> targets();
  std::vector<float> loss_weights() const;

  const CromConfig& config_;
  NsfConfig shared_;  ///< settings that all reduced models have
  SweepSnapshots snapshots_;
  Pod modes_;
  Eigen::MatrixXd latents_;
  rom::Standardization input_, output_;  ///< of (X, q), and of the displacement
};

}  // namespace graupel::train
