// What a run measures, step by step: metrics.csv, metrics.jsonl and a TensorBoard event file in the run folder.
#pragma once

#include <cstdint>
#include <fstream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "train/loop/event_file.h"

namespace graupel::train {

class MetricsLog {
 public:
  using Values = std::vector<std::pair<std::string, double>>;

  /// `columns` are the names that rows may hold. Rows after `last_step` that an earlier, killed part of the run left
  /// are dropped, and a row that they left of an earlier step is not written again: a resumed run logs all once. Throws
  /// IoError.
  MetricsLog(const std::string& folder, std::vector<std::string> columns, int64_t last_step);
  /// One row; absent columns stay empty. Flushed at once.
  void write(int64_t step, const Values& values);

 private:
  std::string folder_;
  std::vector<std::string> columns_;
  /// Rows that the files have from earlier parts of the run, by step and columns.
  std::set<std::string> csv_rows_, jsonl_rows_;
  std::ofstream csv_, jsonl_;
  EventFile events_;
};

}  // namespace graupel::train
