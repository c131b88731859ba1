#include "train/reduced/non_negative_least_squares.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

void check(const Eigen::SparseMatrix<double>& a, const VectorXd& b, const VectorXd& prior) {
  if (a.rows() != b.size() || a.cols() != prior.size())
    throw ConfigError(
        fmt::format("least squares of {} x {} coefficients have {} values and a prior of {} weights (needed: {} and "
                    "{}). Give one of each a row and a column",
                    a.rows(), a.cols(), b.size(), prior.size(), a.rows(), a.cols()));
  const bool finite = std::isfinite(a.squaredNorm()) && b.allFinite() && prior.allFinite();
  if (!finite || (prior.size() > 0 && prior.minCoeff() < 0))
    throw ConfigError(
        "least squares have a value that is not finite, or a prior below 0 (allowed: 0 and above). Correct the data");
}

}  // namespace

VectorXd non_negative_least_squares(const Eigen::SparseMatrix<double>& a, const VectorXd& b, const VectorXd& prior,
                                    const NonNegativeOptions& options) {
  check(a, b, prior);
  VectorXd w = prior, square(a.cols());
  for (Index c = 0; c < a.cols(); ++c) square[c] = a.col(c).squaredNorm();
  VectorXd residual = a * w - b;
  const auto objective = [&] { return residual.squaredNorm() + options.pull * square.dot((w - prior).cwiseAbs2()); };
  double before = objective();
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    for (Index c = 0; c < a.cols(); ++c) {
      if (!(square[c] > 0)) continue;
      const double pull = options.pull * square[c], slope = a.col(c).dot(residual) + pull * (w[c] - prior[c]),
                   weight = std::max(0.0, w[c] - slope / (square[c] + pull));
      residual += (weight - w[c]) * a.col(c);
      w[c] = weight;
    }
    const double now = objective();
    if (before - now <= options.gain * before) break;
    before = now;
  }
  return w;
}

}  // namespace graupel::train
