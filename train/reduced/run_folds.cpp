#include "train/reduced/run_folds.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace graupel::train {

namespace {

constexpr int folds = 4;

using Eigen::Index;
using Eigen::MatrixXd;

}  // namespace

std::vector<Fold> folds_of(const std::vector<int>& run) {
  const std::set<int> distinct(run.begin(), run.end());
  const std::vector<int> runs(distinct.begin(), distinct.end());
  const int inner = static_cast<int>(runs.size()) - 2, count = std::min(folds, inner);
  std::vector<Fold> result;
  for (int f = 0; f < count; ++f) {
    const int held_out = runs[static_cast<std::size_t>(1 + (2 * f + 1) * inner / (2 * count))];
    Fold& fold = result.emplace_back();
    for (std::size_t i = 0; i < run.size(); ++i)
      (run[i] == held_out ? fold.held_out : fold.fitted).push_back(static_cast<Index>(i));
  }
  return result;
}

rom::Standardization column_standardization(const MatrixXd& inputs) {
  rom::Standardization standard;
  for (Index j = 0; j < inputs.cols(); ++j) {
    const double mean = inputs.col(j).mean();
    const double deviation = std::sqrt((inputs.col(j).array() - mean).square().mean());
    standard.shift.push_back(mean);
    standard.scale.push_back(deviation > 1e-12 * (1 + std::abs(mean)) ? 1 / deviation : 1);
  }
  return standard;
}

MatrixXd standardized(const MatrixXd& inputs, const rom::Standardization& by) {
  MatrixXd values = inputs;
  for (Index j = 0; j < inputs.cols(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    values.col(j) = (inputs.col(j).array() - by.shift[at]) * by.scale[at];
  }
  return values;
}

MatrixXd with_ones(const MatrixXd& y) {
  MatrixXd tail(y.rows(), y.cols() + 1);
  tail << Eigen::VectorXd::Ones(y.rows()), y;
  return tail;
}

std::vector<double> row_major(const MatrixXd& m) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = m;
  return {rows.data(), rows.data() + rows.size()};
}

}  // namespace graupel::train
