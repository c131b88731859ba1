#include "train/reduced/map_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "train/reduced/run_folds.h"

namespace graupel::train {

namespace {

constexpr double map_ridges[] = {1e-3, 1e-2, 3e-2, 0.1, 0.3, 1, 3, 10};
constexpr double rate_ridges[] = {1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2};

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd rows_of(const MatrixXd& from, const std::vector<Index>& rows) { return from(rows, Eigen::all); }

/// |a_i - b_j|^3.
MatrixXd cubic_kernel(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd distance2 = -2 * a * b.transpose();
  distance2.colwise() += a.rowwise().squaredNorm();
  distance2.rowwise() += b.rowwise().squaredNorm().transpose();
  return distance2.array().max(0.0).pow(1.5);
}

/// Weights and linear part of the smoothing spline: (K + ridge) w + P l = c, P^T w = 0.
struct Spline {
  MatrixXd weights, linear;
  Spline(const MatrixXd& y, const MatrixXd& c, double ridge) {
    const Index n = y.rows(), p = y.cols() + 1;
    MatrixXd system = MatrixXd::Zero(n + p, n + p), right = MatrixXd::Zero(n + p, c.cols());
    system.topLeftCorner(n, n) = cubic_kernel(y, y);
    system.topLeftCorner(n, n).diagonal().array() += ridge;
    system.topRightCorner(n, p) = with_ones(y);
    system.bottomLeftCorner(p, n) = system.topRightCorner(n, p).transpose();
    system.bottomRightCorner(p, p).diagonal().array() -= 1e-9;  // a constant input would make it singular
    right.topRows(n) = c;
    const MatrixXd solution = system.partialPivLu().solve(right);
    weights = solution.topRows(n);
    linear = solution.bottomRows(p);
  }
};

/// The ridge of a list with the least error over held-out runs; error(ridge, fold) is a sum of squares. The middle one
/// where there are too few runs to hold any out.
template <typename Error>
double best_ridge(const std::vector<Fold>& parts, const double* first, const double* last, const MatrixXd& outputs,
                  double& relative_error, const Error& error) {
  double best = *std::min_element(first, last), least = std::numeric_limits<double>::infinity();
  if (parts.empty()) {  // one run only
    relative_error = 0;
    return first[(last - first) / 2];
  }
  for (const double* ridge = first; ridge != last; ++ridge) {
    double sum = 0;
    for (const Fold& fold : parts) sum += error(*ridge, fold);
    if (sum < least) {
      least = sum;
      best = *ridge;
    }
  }
  double squares = 0;
  for (const Fold& fold : parts) squares += rows_of(outputs, fold.held_out).squaredNorm();
  relative_error = std::sqrt(least / std::max(squares, std::numeric_limits<double>::min()));
  return best;
}

/// Rows far from each other, the first one nearest to the mean.
std::vector<Index> spread_rows(const MatrixXd& y, int count) {
  Index farthest;
  y.rowwise().squaredNorm().minCoeff(&farthest);
  std::vector<Index> chosen;
  VectorXd least = VectorXd::Constant(y.rows(), std::numeric_limits<double>::infinity());
  while (static_cast<int>(chosen.size()) < std::min<Index>(count, y.rows())) {
    chosen.push_back(farthest);
    least = least.cwiseMin((y.rowwise() - y.row(farthest)).rowwise().squaredNorm());
    if (!(least.maxCoeff(&farthest) > 0)) break;
  }
  return chosen;
}

}  // namespace

MapFit fit_map(const MatrixXd& inputs, const MatrixXd& outputs, const std::vector<int>& run, int centers) {
  if (centers < inputs.rows()) return fit_rate_map(inputs, MatrixXd::Ones(inputs.rows(), 1), outputs, run, centers);
  const rom::Standardization standard = column_standardization(inputs);
  const MatrixXd y = standardized(inputs, standard);
  MapFit fit;
  fit.ridge = best_ridge(folds_of(run), std::begin(map_ridges), std::end(map_ridges), outputs, fit.held_out_error,
                         [&](double ridge, const Fold& fold) {
                           const MatrixXd fitted = rows_of(y, fold.fitted), held_out = rows_of(y, fold.held_out);
                           const Spline spline(fitted, rows_of(outputs, fold.fitted), ridge);
                           const MatrixXd predicted =
                               cubic_kernel(held_out, fitted) * spline.weights + with_ones(held_out) * spline.linear;
                           return (predicted - rows_of(outputs, fold.held_out)).squaredNorm();
                         });
  const Spline spline(standardized(inputs, standard), outputs, fit.ridge);
  fit.map = {static_cast<int>(inputs.cols()),
             static_cast<int>(outputs.cols()),
             standard.shift,
             standard.scale,
             row_major(inputs),
             row_major(spline.weights),
             row_major(spline.linear)};
  return fit;
}

MapFit fit_rate_map(const MatrixXd& inputs, const MatrixXd& rates, const MatrixXd& outputs, const std::vector<int>& run,
                    int centers) {
  const rom::Standardization standard = column_standardization(inputs);
  const MatrixXd y = standardized(inputs, standard);
  const std::vector<Index> chosen = spread_rows(y, centers);
  const MatrixXd middle = rows_of(y, chosen);
  // Features (1, y, |y - y_i|^3) times each rate, all of mean square 1.
  const Index r = rates.cols(), radial = middle.rows(), linear = y.cols() + 1, count = linear + radial;
  const auto features_of = [&](const MatrixXd& places, const MatrixXd& place_rates) {
    MatrixXd shapes(places.rows(), count), features(places.rows(), count * r);
    shapes << with_ones(places), cubic_kernel(places, middle);
    for (Index s = 0; s < count; ++s)
      for (Index j = 0; j < r; ++j) features.col(s * r + j) = shapes.col(s).cwiseProduct(place_rates.col(j));
    return features;
  };
  MatrixXd features = features_of(y, rates);
  const VectorXd size =
      (features.colwise().squaredNorm() / static_cast<double>(y.rows())).cwiseSqrt().cwiseMax(1e-30).transpose();
  features.array().rowwise() /= size.transpose().array();
  const auto solve = [&](const MatrixXd& a, const MatrixXd& c, double ridge) {
    MatrixXd normal = a.transpose() * a;
    normal.diagonal().array() += ridge * static_cast<double>(a.rows());
    return MatrixXd(normal.ldlt().solve(a.transpose() * c));
  };
  const auto fitted_features = [&](const Fold& fold) {
    MatrixXd fitted = features_of(rows_of(y, fold.fitted), rows_of(rates, fold.fitted));
    fitted.array().rowwise() /= size.transpose().array();
    return fitted;
  };
  MapFit fit;
  fit.ridge =
      best_ridge(folds_of(run), std::begin(rate_ridges), std::end(rate_ridges), outputs, fit.held_out_error,
                 [&](double ridge, const Fold& fold) {
                   const MatrixXd w = solve(fitted_features(fold), rows_of(outputs, fold.fitted), ridge);
                   return (rows_of(features, fold.held_out) * w - rows_of(outputs, fold.held_out)).squaredNorm();
                 });
  const MatrixXd solution = solve(features, outputs, fit.ridge);
  // Row of shape s: outputs [m, r].
  const Index m = outputs.cols();
  MatrixXd by_shape(count, m * r);
  for (Index s = 0; s < count; ++s)
    for (Index k = 0; k < m; ++k)
      for (Index j = 0; j < r; ++j) by_shape(s, k * r + j) = solution(s * r + j, k) / size[s * r + j];
  fit.map = {static_cast<int>(inputs.cols()),
             static_cast<int>(m * r),
             standard.shift,
             standard.scale,
             row_major(rows_of(inputs, chosen)),
             row_major(by_shape.bottomRows(radial)),
             row_major(by_shape.topRows(linear))};
  return fit;
}

}  // namespace graupel::train
