#include "train/config/train_config.h"

#include <algorithm>
#include <cmath>

namespace graupel::train {

NetworkConfig TrainConfig::network() const {
  if (architecture == Architecture::gns) return gns;
  return hgn;
}

const graph::FeatureConfig& TrainConfig::features() const {
  if (architecture == Architecture::gns) return gns;
  return hgn;
}

double TrainConfig::rate_at(int64_t step, double share) const {
  const auto all = static_cast<double>(steps), at = std::max(static_cast<double>(step), share * all);
  const double fraction = schedule == RateSchedule::cosine
                              ? 0.5 * (1 + std::cos(M_PI * std::min(at / all, 1.0)))
                              : std::pow(0.1, at / (decay_steps > 0 ? static_cast<double>(decay_steps) : all / 4));
  const double rate = final_learning_rate + (learning_rate - final_learning_rate) * fraction;
  return step < warm_up_steps ? rate * static_cast<double>(step + 1) / static_cast<double>(warm_up_steps) : rate;
}

double TrainConfig::ema_decay_at(int64_t step) const {
  const auto at = static_cast<double>(step);
  return std::min(ema_decay, (1 + at) / (10 + at));
}

double TrainConfig::jitter_width() const {
  if (architecture != Architecture::hgn) return 0;
  switch (jitter) {
    case GridJitter::coarsest:
      return hgn.spacing * static_cast<double>(int64_t{1} << (hgn.levels - 1));
    case GridJitter::finest:
      return hgn.spacing;
    case GridJitter::none:
      return 0;
  }
  return 0;
}

}  // namespace graupel::train
