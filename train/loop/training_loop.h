// Trains a graph network on a data set, in a run folder; stops, resumes and validates.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "core/parallel/device.h"
#include "train/config/train_config.h"
#include "train/loop/evaluation.h"
#include "train/parallel/comm.h"

namespace graupel::train {

/// State of a run, reported every `log_interval` steps.
struct TrainingProgress {
  int64_t step = 0, steps = 0;
  double loss = 0;          ///< mean since the last report
  double loss_average = 0;  ///< moving average of the loss
  double learning_rate = 0;
  double steps_per_second = 0;  ///< since the last report
  double scenes_per_second = 0;
  double seconds_left = 0;
};

struct Validation {
  int64_t step = -1;
  OneStepErrors one_step;
  double rollout_mse = std::numeric_limits<double>::quiet_NaN();  ///< [m^2]; NaN: not measured
};

/// Throws ConfigError where some of the processes would have no scene of a batch.
void check_rank_count(int ranks, const TrainConfig& config);

enum class StopReason { finished, out_of_time, stopped, reached_stop_step };
const char* name_of(StopReason reason);

struct TrainingOptions {
  std::string data;  ///< folder with train.h5 and, for validation, valid.h5
  std::string run;   ///< run folder, see run_folder.h
  TrainConfig config;
  std::string from;  ///< weights file to start a new run from, with its normalisation; "": fresh weights
  /// Weights file of a network to learn from (distillation), of a resumed run the same one; "": the data alone.
  std::string teacher;
  bool resume = false;             ///< go on from the newest sound checkpoint; config must be the run's
  Comm* comm = &single_process();  ///< the run's ranks: each takes its share of every batch, rank 0 alone writes files
  int local_ranks = 1;             ///< those of this machine, which share its memory
  Device device = Device::cpu;
  int threads = 1;        ///< of this rank, for libtorch on the CPU, and for the workers that prepare batches
  double minutes = 0;     ///< stop after this wall time, with a checkpoint; 0: never
  int64_t stop_step = 0;  ///< stop after this step, with a checkpoint; 0: never
  std::string command_line;
  std::string version;
  std::function<bool()> should_stop;  ///< asked after every step; one rank's answer is enough
  std::function<void(const TrainingProgress&)> progress;
  std::function<void(const std::string&)> message;
};

struct TrainingResult {
  StopReason reason = StopReason::finished;
  int64_t step = 0;
  int64_t scene_samples = 0;
  double seconds = 0;  ///< of training, over all parts of the run
  double loss_average = 0;
  int64_t parameters = 0;
  double best_validation = -1;  ///< normalised one-step error; -1: none
  int64_t best_step = -1;
  std::optional<Validation> validation;  ///< the last one of this part
  std::string weights_file;
};

/// Throws ConfigError, InputError, IoError; DivergedError when the loss is no longer a number.
TrainingResult train_network(const TrainingOptions& options);

}  // namespace graupel::train
