#include "train/run_interpolation.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "core/error.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;

RunInterpolation::RunInterpolation(std::vector<double> values, int count) : values_(std::move(values)), count_(count) {}

RunInterpolation RunInterpolation::of(const SnapshotSet& set, int64_t count) {
  if (count == 0) return {};
  const auto refuse = [&](const std::string& what) {
    return ConfigError(fmt::format("between_runs is {}, but {}. Set it to 0", count, what));
  };
  if (set.parameters().size() != 1)
    throw refuse(fmt::format("the sweep has {} parameters (needed: one)", set.parameters().size()));
  const SweptParameter& parameter = set.parameters().front();
  const int64_t length = set.first_snapshot(1);
  for (int run = 1; run < set.runs(); ++run)
    if (set.first_snapshot(run + 1) - set.first_snapshot(run) != length)
      throw refuse(fmt::format("run {} has {} snapshots, run 0 {} (needed: as many in each)", run,
                               set.first_snapshot(run + 1) - set.first_snapshot(run), length));
  std::vector<double> sorted = parameter.values;
  std::sort(sorted.begin(), sorted.end());
  const auto same = std::adjacent_find(sorted.begin(), sorted.end());
  if (same != sorted.end()) throw refuse(fmt::format("two runs have the same {} ({})", parameter.name, *same));
  return {parameter.values, static_cast<int>(count)};
}

MatrixXd RunInterpolation::extend(const MatrixXd& rows, const std::vector<int>& run) const {
  if (count_ == 0 || run.empty()) return rows;
  std::map<double, Index> first;  // row of each run, by its value
  for (std::size_t i = run.size(); i-- > 0;) first[values_[static_cast<std::size_t>(run[i])]] = static_cast<Index>(i);
  const Index length = rows.rows() / static_cast<Index>(first.size());
  MatrixXd extended(rows.rows() + (static_cast<Index>(first.size()) - 1) * count_ * length, rows.cols());
  extended.topRows(rows.rows()) = rows;
  Index next = rows.rows();
  for (auto low = first.begin(), high = std::next(low); high != first.end(); ++low, ++high)
    for (int i = 1; i <= count_; ++i, next += length) {
      const double share = static_cast<double>(i) / (count_ + 1);
      extended.middleRows(next, length) =
          (1 - share) * rows.middleRows(low->second, length) + share * rows.middleRows(high->second, length);
    }
  return extended;
}

}  // namespace graupel::train
