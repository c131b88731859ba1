#include "rom/solver/error_indicator.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace graupel::rom {

namespace {

constexpr double ErrorIndicator::*indicators[] = {&ErrorIndicator::residual, &ErrorIndicator::down_weighted,
                                                  &ErrorIndicator::latent_distance};
constexpr std::ptrdiff_t beside = 2;  ///< frames on either side that count for a level

/// What is usual of one indicator.
std::vector<double> levels_of(const std::vector<std::vector<ErrorIndicator>>& runs, double ErrorIndicator::*indicator,
                              std::ptrdiff_t frames) {
  std::vector<double> levels(static_cast<std::size_t>(frames), 0);
  for (const std::vector<ErrorIndicator>& run : runs)
    for (std::ptrdiff_t f = 0; f < frames; ++f)
      for (std::ptrdiff_t g = std::max<std::ptrdiff_t>(0, f - beside);
           g <= f + beside && g < static_cast<std::ptrdiff_t>(run.size()); ++g)
        levels[static_cast<std::size_t>(f)] =
            std::max(levels[static_cast<std::size_t>(f)], run[static_cast<std::size_t>(g)].*indicator);
  std::vector<double> sorted = levels;
  const auto middle = sorted.begin() + frames / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  for (double& level : levels) level = std::max(level, 0.5 * *middle);
  return levels;
}

}  // namespace

TrustLevels usual_levels(const std::vector<std::vector<ErrorIndicator>>& runs) {
  std::size_t frames = 0;
  for (const auto& run : runs) frames = std::max(frames, run.size());
  TrustLevels usual(frames);
  if (frames == 0) return usual;
  for (const auto indicator : indicators) {
    const std::vector<double> levels = levels_of(runs, indicator, static_cast<std::ptrdiff_t>(frames));
    for (std::size_t f = 0; f < frames; ++f) usual[f].*indicator = levels[f];
  }
  for (ErrorIndicator& frame : usual) {
    frame.down_weighted = std::max(frame.down_weighted, 0.02);
    frame.latent_distance = std::max(frame.latent_distance, 1.0);
  }
  return usual;
}

const char* verdict_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::ok:
      return "ok";
    case Verdict::doubtful:
      return "doubtful";
    case Verdict::do_not_trust:
      return "do not trust";
    case Verdict::unknown:
      break;
  }
  return "unknown";
}

ErrorIndicatorRecord::ErrorIndicatorRecord(TrustLevels usual, double material_difference, double training_error)
    : usual_(std::move(usual)),
      from_materials_(material_difference / usual_material_difference),
      training_error_(training_error) {}

double ErrorIndicatorRecord::add(const ErrorIndicator& frame) {
  double number = from_materials_;
  if (!usual_.empty()) {
    constexpr double least = 1e-12;
    const ErrorIndicator& usual = usual_[std::min(numbers_.size(), usual_.size() - 1)];
    for (const auto indicator : indicators)
      number = std::max(number, frame.*indicator / std::max(usual.*indicator, least));
  }
  numbers_.push_back(number);
  double sum = 0;
  const std::size_t count = std::min<std::size_t>(window, numbers_.size());
  for (std::size_t i = numbers_.size() - count; i < numbers_.size(); ++i) sum += numbers_[i];
  largest_ = std::max(largest_, sum / window);
  return number;
}

Verdict ErrorIndicatorRecord::verdict() const {
  if (diverged_) return Verdict::do_not_trust;
  const double error = bound_.value_or(training_error_), number = bound_ ? from_materials_ : largest_;
  if (number > do_not_trust || error > failed_error) return Verdict::do_not_trust;
  if (number > doubtful || error > doubtful_error || foreign_scene_) return Verdict::doubtful;
  return !bound_ && (usual_.empty() || numbers_.empty()) ? Verdict::unknown : Verdict::ok;
}

}  // namespace graupel::rom
