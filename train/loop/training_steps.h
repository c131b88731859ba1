// The steps of a run: a batch, made on the device or by worker threads, with the targets of the data and of a teacher
// where there is one, and what the network learns from it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "train/data/data_set.h"
#include "train/networks/teacher.h"
#include "train/parallel/comm.h"

namespace graupel::train {

/// What the steps of a run are made of; all of it outlives them.
struct StepSources {
  const DataSplit& split;
  const TrainConfig& config;
  const graph::Normalization& normalization;
  Teacher* teacher;  ///< null: the targets are the data's alone
  NetworkModule& module;
  Comm& comm;
  Device device;
  int threads;
};

class TrainingSteps {
 public:
  virtual ~TrainingSteps() = default;
  /// The next step, from the first one on.
  virtual void take(const StepSettings& settings) = 0;
};

/// The steps from number `first` on, counted from 0. Says where batches are made more slowly than they could be. Throws
/// ConfigError where the network's own frames (push_steps) need a data set in the device's memory that does not fit.
std::unique_ptr<TrainingSteps> make_training_steps(const StepSources& sources, int64_t first,
                                                   const std::function<void(const std::string&)>& say);

}  // namespace graupel::train
