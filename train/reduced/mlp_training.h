// Trains the paper's networks (NSF section 4.4) on the runs of a parameter sweep, in a run folder, in three stages: the
// deformation (with the encoder where it is the paper's), then stress and affine velocity on its latents. Stops,
// resumes, keeps to a time limit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rom/reduced_model.h"
#include "train/config/nsf_config.h"
#include "train/reduced/mlp/stage_run.h"

namespace graupel::train {

/// What the training tells about a network.
struct MlpStageReport {
  std::string name;
  int width = 0;
  int64_t steps = 0;
  double seconds = 0;
  double loss = 0;  ///< mean of squares of standardised outputs, since the last line of the log
  double error =
      0;  ///< over training snapshots: root of the sum of squared errors over that of deviations from the mean
};

struct MlpReport {
  std::vector<MlpStageReport> stages;
  int64_t snapshots = 0;
  double latent_tail = 0;                ///< root of the share of squares that the latent's modes leave out
  double read_seconds = 0, seconds = 0;  ///< of this part of the run
  double run_seconds = 0;                ///< of all its parts
  StopReason reason = StopReason::finished;
};

struct MlpTrainingOptions : StageRunOptions {
  NsfConfig config;
};

/// Nothing when it was stopped. Throws InputError for a data set that is no sweep, ConfigError for settings that do not
/// fit it, DivergedError when the loss is no longer a number.
std::optional<rom::ReducedModel> train_mlp(const MlpTrainingOptions& options, MlpReport& report);

}  // namespace graupel::train
