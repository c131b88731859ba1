// Times of frames of a network that predicts several at once, in equal parts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace graupel::experiments {

/// What a bundle of frames costs at its first or its last one counts for all of them alike, so that medians are those
/// of a frame.
class BundleTimes {
 public:
  BundleTimes(int64_t bundle, int64_t frames) : bundle_(bundle), frames_(frames) {}
  /// `frame` counts from 1; the last bundle may be cut.
  void add(int64_t frame, double seconds) {
    sum_ += seconds;
    ++count_;
    if (frame % bundle_ != 0 && frame != frames_) return;
    times_.insert(times_.end(), count_, std::max(0.0, sum_ / static_cast<double>(count_)));
    sum_ = 0;
    count_ = 0;
  }
  /// Of the frames of whole bundles [s].
  const std::vector<double>& times() const { return times_; }

 private:
  int64_t bundle_, frames_;
  double sum_ = 0;
  std::size_t count_ = 0;
  std::vector<double> times_;
};

}  // namespace graupel::experiments
