#include "compare/metrics/displacement_error.h"

#include <cmath>

#include "core/system/error.h"

namespace graupel::compare {

void DisplacementError::add(const std::vector<Vec3f>& truth, const std::vector<Vec3d>& run,
                            const std::vector<uint8_t>& counted) {
  GRAUPEL_ASSERT(truth.size() == reference_.size() && run.size() == reference_.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!counted.empty() && counted[i] == 0) continue;
    const Vec3d x = truth[i].cast<double>();
    error2_ += norm2(space_.difference(run[i], x));
    position2_ += norm2(x);
    displacement2_ += norm2(space_.difference(x, reference_[i].cast<double>()));
    ++count_;
  }
}

void DisplacementError::add(const std::vector<Vec3f>& truth, const std::vector<Vec3f>& run,
                            const std::vector<uint8_t>& counted) {
  std::vector<Vec3d> position;
  position.reserve(run.size());
  for (const Vec3f& x : run) position.push_back(x.cast<double>());
  add(truth, position, counted);
}

double DisplacementError::delta() const { return position2_ > 0 ? std::sqrt(error2_ / position2_) : 0; }
double DisplacementError::displacement_relative() const {
  return displacement2_ > 0 ? std::sqrt(error2_ / displacement2_) : 0;
}
double DisplacementError::root_mean_square() const {
  return count_ > 0 ? std::sqrt(error2_ / static_cast<double>(count_)) : 0;
}

}  // namespace graupel::compare
