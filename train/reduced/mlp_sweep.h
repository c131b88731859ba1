// What the paper's networks (NSF section 4.4) are taught of a sweep: for each stage of the training the network with
// its data, standardised, on the device; the latents that the later stages and the model take from the first.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "rom/networks/conv_encoder.h"
#include "rom/networks/mlp.h"
#include "train/reduced/mlp/mlp_module.h"
#include "train/reduced/sweep_snapshots.h"

namespace graupel::train {

/// Stages of the training, in their order.
struct MlpStageKind {
  const char* name;
  SnapshotField field;
};
inline constexpr int mlp_stage_count = 3;
inline constexpr MlpStageKind mlp_stage_kinds[mlp_stage_count] = {
    {"deformation", SnapshotField::position}, {"stress", SnapshotField::stress}, {"affine", SnapshotField::affine}};

/// A network and what training keeps of it.
struct MlpStage {
  MlpShape shape;
  rom::Standardization input, output;
  std::optional<MlpModule> module;
  int64_t points = 0;  ///< that batches are drawn from

  rom::Mlp network(const nn::Weights& weights) const;
};

class MlpSweep {
 public:
  /// `data` as SweepSnapshots; `config` must outlive this.
  MlpSweep(const std::string& data, const NsfConfig& config, std::function<void(const std::string&)> message);

  SweepSnapshots& snapshots() { return snapshots_; }
  const SweepSnapshots& snapshots() const { return snapshots_; }
  /// The network of a stage with its data; the latents must be known after the first. Throws ConfigError when the
  /// snapshots have fewer modes than there are latents.
  MlpStage prepare(int stage, Device device);
  /// The encoder of the first stage, nothing where the latents are coefficients of modes. Sets the latents that it
  /// gives.
  std::optional<rom::ConvEncoder> take_encoder(const MlpStage& stage, const nn::Weights& weights);
  /// Root of the share of squares that the latents' modes leave out.
  double latent_tail() const { return latent_tail_; }
  /// As SweepSnapshots::describe.
  void describe(rom::ReducedModel& model) const;
  /// X of all particles, [particles, 3].
  std::vector<float> reference() const;

 private:
  bool conv() const { return config_.mlp.encoder == EncoderKind::conv; }
  void set_points(int number, MlpStage& stage) const;
  void set_states(MlpStage& stage) const;
  void set_positions(MlpStage& stage);
  void set_latents(const std::vector<float>& position);
  void set_output(MlpStage& stage, std::vector<float> values) const;
  std::vector<double> latent_scale() const;

  const NsfConfig& config_;
  std::function<void(const std::string&)> message_;
  SweepSnapshots snapshots_;
  Eigen::MatrixXd latents_;  ///< of the training snapshots
  rom::Standardization position_;
  double latent_tail_ = 0;
};

}  // namespace graupel::train
