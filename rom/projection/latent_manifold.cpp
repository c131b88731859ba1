#include "rom/projection/latent_manifold.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace graupel::rom {

using Eigen::Index;

LatentManifold::LatentManifold(const std::vector<float>& latents, int r, const std::vector<int32_t>& run,
                               int dimensions)
    : latents_(Eigen::Map<const Eigen::MatrixXf>(latents.data(), r, static_cast<Index>(run.size())).cast<double>()),
      dimensions_(dimensions) {
  for (std::size_t i = 0; i < run.size(); ++i)
    if (i == 0 || run[i] != run[i - 1]) first_.push_back(static_cast<Index>(i));
  first_.push_back(static_cast<Index>(run.size()));
}

Eigen::VectorXd LatentManifold::project(const Eigen::VectorXd& q) const {
  const std::size_t runs = first_.empty() ? 0 : first_.size() - 1;
  if (runs < 2 || dimensions_ >= q.size()) return q;
  const Eigen::VectorXd distance2 = (latents_.colwise() - q).colwise().squaredNorm();
  std::vector<std::pair<double, Index>> nearest;  // of every run
  for (std::size_t run = 0; run < runs; ++run) {
    Index at;
    const double least = distance2.segment(first_[run], first_[run + 1] - first_[run]).minCoeff(&at);
    nearest.emplace_back(least, first_[run] + at);
  }
  const auto used = std::min<std::size_t>(runs, static_cast<std::size_t>(2 * dimensions_));
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(used), nearest.end());
  // Nearer runs count more; the furthest that is used sets the scale.
  const double scale2 = std::max(nearest[used - 1].first, 1e-30);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(q.size());
  Eigen::MatrixXd points(q.size(), static_cast<Index>(3 * used));
  Eigen::VectorXd weight(points.cols());
  Index count = 0;
  for (std::size_t i = 0; i < used; ++i) {
    const Index at = nearest[i].second;
    const auto run = std::upper_bound(first_.begin(), first_.end(), at) - 1;
    for (Index step = -1; step <= 1; ++step) {
      if (at + step < run[0] || at + step >= run[1]) continue;
      points.col(count) = latents_.col(at + step);
      weight[count] = 1 / (nearest[i].first + 0.1 * scale2);
      mean += weight[count] * points.col(count);
      ++count;
    }
  }
  mean /= weight.head(count).sum();
  const Eigen::MatrixXd spread = points.leftCols(count).colwise() - mean;
  const Eigen::MatrixXd covariance = spread * weight.head(count).asDiagonal() * spread.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const Eigen::MatrixXd plane = solver.eigenvectors().rightCols(dimensions_);
  return mean + plane * (plane.transpose() * (q - mean));
}

Eigen::MatrixXd LatentManifold::between(const std::vector<float>& values, double value) const {
  const std::size_t runs = first_.empty() ? 0 : first_.size() - 1;
  if (runs < 2 || values.size() != runs) return {};
  const Index length = first_[1] - first_[0];
  for (std::size_t run = 0; run < runs; ++run)
    if (first_[run + 1] - first_[run] != length) return {};
  std::vector<std::size_t> order(runs);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::size_t above = 1;
  while (above + 1 < runs && static_cast<double>(values[order[above]]) < value) ++above;
  const std::size_t low = order[above - 1], high = order[above];
  const double from = static_cast<double>(values[low]), to = static_cast<double>(values[high]);
  const double fraction = to > from ? (value - from) / (to - from) : 0.0;
  return (1 - fraction) * latents_.middleCols(first_[low], length) +
         fraction * latents_.middleCols(first_[high], length);
}

Eigen::VectorXd nearest_on_curve(const Eigen::MatrixXd& curve, const Eigen::VectorXd& q, double place) {
  Eigen::VectorXd best = q;
  double least = std::numeric_limits<double>::infinity();
  const auto curve_index = static_cast<Index>(place);
  for (Index i = std::max<Index>(0, curve_index - curve_window);
       i + 1 < curve.cols() && i <= curve_index + curve_window; ++i) {
    const Eigen::VectorXd way = curve.col(i + 1) - curve.col(i);
    const double fraction = std::clamp(way.dot(q - curve.col(i)) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
    const Eigen::VectorXd point = curve.col(i) + fraction * way;
    const double distance = (q - point).squaredNorm();
    if (distance >= least) continue;
    least = distance;
    best = point;
  }
  return best;
}

}  // namespace graupel::rom
