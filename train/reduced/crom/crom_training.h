// Trains a reduced-order model of the deformation alone (CROM section 4) on the runs of a parameter sweep, in a run
// folder. Latents are the coefficients of the positions' first modes. Stops, resumes, keeps to a time limit.
#pragma once

#include <optional>

#include "rom/reduced_model.h"
#include "train/config/crom_config.h"
#include "train/reduced/crom/reconstruction.h"
#include "train/reduced/error_calibration.h"
#include "train/reduced/mlp/stage_run.h"

namespace graupel::train {

struct CromReport {
  int64_t snapshots = 0;
  double latent_tail = 0;  ///< root of the share of squares that the latents' modes leave out
  int64_t steps = 0;
  double loss = 0;                ///< since the last line of the log; 0 when an earlier part of the run finished
  ReconstructionErrors training;  ///< of about 64 snapshots
  std::optional<ReconstructionErrors> test;  ///< of about 64 in test.h5, where the data set has it
  CalibrationReport calibration;
  double read_seconds = 0, seconds = 0;  ///< of this part of the run
  double run_seconds = 0;                ///< of all its parts
  StopReason reason = StopReason::finished;
};

struct CromTrainingOptions : StageRunOptions {
  CromConfig config;
};

/// Nothing when it was stopped. Throws InputError for a data set that is no sweep, ConfigError for settings that do not
/// fit it, DivergedError when the loss is no longer a number.
std::optional<rom::ReducedModel> train_crom(const CromTrainingOptions& options, CromReport& report);

}  // namespace graupel::train
