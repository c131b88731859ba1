// Trains the paper's networks (NSF section 4.4) on the runs of a parameter sweep, in a run folder, in three stages: the
// deformation (with the encoder where it is the paper's), then stress and affine velocity on its latents. Stops,
// resumes, keeps to a time limit.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "core/parallel/device.h"
#include "rom/reduced_model.h"
#include "train/config/nsf_config.h"
#include "train/loop/training_loop.h"

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

struct MlpTrainingOptions {
  std::string data;  ///< folder of the data set; its train.h5 is read
  std::string run;   ///< run folder (train/loop/run_folder.h)
  NsfConfig config;
  bool resume = false;  ///< go on from the newest sound checkpoint; config must be the run's
  Device device = Device::cpu;
  int threads = 1;
  double time_limit = 0;  ///< [s] of the whole run, divided among the stages as their epochs are; 0: none
  int64_t stop_step = 0;  ///< stop after this step of the run; 0: do not
  std::string command_line, version;
  std::function<void(const std::string&)> message = {};
  std::function<bool()> should_stop = {};
  std::map<std::string, std::string> provenance = {};  ///< kept in the weights' metadata
};

/// Nothing when it was stopped. Throws InputError for a data set that is no sweep, ConfigError for settings that do not
/// fit it, DivergedError when the loss is no longer a number.
std::optional<rom::ReducedModel> train_mlp(const MlpTrainingOptions& options, MlpReport& report);

}  // namespace graupel::train
