// Progress of long work on standard error: one line with an ETA on a terminal, a line every ten seconds elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "core/system/human_time.h"

namespace graupel::experiments {

class Progress {
 public:
  /// Shows nothing when `total` is 0.
  Progress(const std::string& label, int64_t total);
  /// Ends the line of work that was not done.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` items are finished; `detail` is appended to the line.
  void update(int64_t done, const std::string& detail = "");
  /// All work is done: says so and ends the line.
  void done();

 private:
  using Clock = std::chrono::steady_clock;
  void print(int64_t done, const std::string& detail, bool last);

  std::string label_;
  int64_t total_;
  bool terminal_, finished_ = false, printed_ = false;
  Clock::time_point start_, last_print_;
};

/// "1.5 GB".
std::string human_bytes(double bytes);

}  // namespace graupel::experiments
