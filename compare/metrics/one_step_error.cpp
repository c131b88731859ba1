#include "compare/metrics/one_step_error.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::compare {

std::vector<Vec3d> frame_accelerations(const std::vector<Vec3f>& before, const std::vector<Vec3f>& current,
                                       const std::vector<Vec3f>& next) {
  std::vector<Vec3d> acceleration(current.size());
  for (std::size_t i = 0; i < current.size(); ++i)
    acceleration[i] = next[i].cast<double>() - 2.0 * current[i].cast<double>() + before[i].cast<double>();
  return acceleration;
}

OneStepAccumulator::OneStepAccumulator(const Vec3d& gravity, double frame_time, double dx)
    : ballistic_(gravity * (frame_time * frame_time)), dx_(dx) {}

ParticleState OneStepAccumulator::state_of(const Vec3d& acceleration, double clearance) const {
  if (norm(acceleration - ballistic_) < 0.05 * norm(ballistic_)) return ParticleState::airborne;
  return clearance < 2 * dx_ ? ParticleState::near_obstacle : ParticleState::bulk;
}

void OneStepAccumulator::add(const std::vector<Vec3d>& predicted, const std::vector<Vec3d>& truth,
                             const std::vector<double>& clearance, const std::vector<uint8_t>& kinematic) {
  GRAUPEL_ASSERT(predicted.size() == truth.size() && clearance.size() == truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!kinematic.empty() && kinematic[i] != 0) continue;
    ++count_;
    const double error = norm2(predicted[i] - truth[i]);
    const auto state = static_cast<std::size_t>(state_of(truth[i], clearance[i]));
    model_ += error;
    state_error_[state] += error;
    state_count_[state] += 1;
    zero_ += norm2(truth[i]);
    fall_ += norm2(truth[i] - ballistic_);
    truth_sum_ += truth[i];
    truth_squares_ += norm2(truth[i]);
  }
}

OneStepError OneStepAccumulator::result() const {
  OneStepError e;
  const double smallest = 1e-8 * dx_ * dx_;
  e.variance = smallest;
  if (count_ == 0) return e;
  e.model = model_ / count_;
  e.zero = zero_ / count_;
  e.ballistic = fall_ / count_;
  e.variance = std::max(smallest, truth_squares_ / count_ - norm2(truth_sum_ * (1 / count_)));
  for (std::size_t s = 0; s < 3; ++s) {
    e.share[s] = state_count_[s] / count_;
    e.model_by_state[s] = state_count_[s] > 0 ? state_error_[s] / state_count_[s] : 0;
  }
  return e;
}

}  // namespace graupel::compare
