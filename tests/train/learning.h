// Short runs that learn the tiny data set (tests/train/tiny_data.h).
#pragma once

#include "train/loop/training_loop.h"

namespace graupel::train {

/// Losses of a run's first and last line of metrics.
struct LossCourse {
  double first = 0, last = 0;
  void add(double loss) {
    if (first == 0) first = loss;
    last = loss;
  }
};

/// Sets so many steps that learn fast, with a validation at the end, and follows their loss.
inline void learn_fast(TrainingOptions& options, int64_t steps, LossCourse& loss) {
  TrainConfig& config = options.config;
  config.steps = config.checkpoint_interval = config.validation_interval = steps;
  config.schedule = RateSchedule::cosine;
  config.log_interval = 20;
  config.ema_decay = 0.98;
  options.progress = [&loss](const TrainingProgress& p) { loss.add(p.loss); };
}

}  // namespace graupel::train
