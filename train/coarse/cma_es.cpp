#include "train/coarse/cma_es.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::train {

CmaEs::CmaEs(const std::vector<double>& start, const std::vector<double>& spread, int samples, uint64_t seed)
    : samples_(samples), seed_(seed) {
  GRAUPEL_ASSERT(start.size() == spread.size() && !start.empty() && samples >= 4);
  const auto n = static_cast<Eigen::Index>(start.size());
  spread_ = Eigen::Map<const Eigen::VectorXd>(spread.data(), n);
  mean_ = Eigen::Map<const Eigen::VectorXd>(start.data(), n).cwiseQuotient(spread_);
  weights_.resize(samples / 2);
  for (Eigen::Index i = 0; i < weights_.size(); ++i)
    weights_[i] = std::log((samples + 1) / 2.0) - std::log(static_cast<double>(i + 1));
  weights_ /= weights_.sum();
  mass_ = 1 / weights_.squaredNorm();
  path_sigma_ = path_c_ = Eigen::VectorXd::Zero(n);
  covariance_ = axes_ = inverse_root_ = Eigen::MatrixXd::Identity(n, n);
}

std::vector<std::vector<double>> CmaEs::sample() {
  const Eigen::Index n = mean_.size();
  const Random random(seed_, RandomPurpose::weight_init, static_cast<uint64_t>(generation_));
  drawn_.clear();
  std::vector<std::vector<double>> points;
  for (int k = 0; k < samples_; ++k) {
    Eigen::VectorXd z(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      double unused;
      random.normal(static_cast<uint64_t>(k) * static_cast<uint64_t>(n) + static_cast<uint64_t>(i), 0, z[i], unused);
    }
    drawn_.push_back(axes_ * z);
    const Eigen::VectorXd x = scaled(mean_ + sigma_ * drawn_.back());
    points.emplace_back(x.data(), x.data() + n);
  }
  return points;
}

void CmaEs::update(const std::vector<double>& costs) {
  GRAUPEL_ASSERT(costs.size() == drawn_.size());
  const auto n = static_cast<double>(mean_.size());
  std::vector<std::size_t> order(costs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto rank = [&](std::size_t k) { return std::isfinite(costs[k]) ? costs[k] : HUGE_VAL; };
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });

  Eigen::VectorXd step = Eigen::VectorXd::Zero(mean_.size());  // <y>_w
  for (Eigen::Index i = 0; i < weights_.size(); ++i) step += weights_[i] * drawn_[order[static_cast<std::size_t>(i)]];
  mean_ += sigma_ * step;

  const double rate_sigma = (mass_ + 2) / (n + mass_ + 5);
  const double damping = 1 + 2 * std::max(0.0, std::sqrt((mass_ - 1) / (n + 1)) - 1) + rate_sigma;
  const double expected = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));  // E |N(0, I)|
  path_sigma_ =
      (1 - rate_sigma) * path_sigma_ + std::sqrt(rate_sigma * (2 - rate_sigma) * mass_) * inverse_root_ * step;
  const double length =
      path_sigma_.norm() / std::sqrt(1 - std::pow(1 - rate_sigma, 2.0 * static_cast<double>(generation_ + 1)));
  const double stalled = length < (1.4 + 2 / (n + 1)) * expected ? 1 : 0;  // h_sigma

  const double rate_c = (4 + mass_ / n) / (n + 4 + 2 * mass_ / n);
  const double rate_1 = 2 / ((n + 1.3) * (n + 1.3) + mass_);
  const double rate_mu = std::min(1 - rate_1, 2 * (mass_ - 2 + 1 / mass_) / ((n + 2) * (n + 2) + mass_));
  path_c_ = (1 - rate_c) * path_c_ + stalled * std::sqrt(rate_c * (2 - rate_c) * mass_) * step;
  Eigen::MatrixXd of_samples = Eigen::MatrixXd::Zero(mean_.size(), mean_.size());
  for (Eigen::Index i = 0; i < weights_.size(); ++i) {
    const Eigen::VectorXd& y = drawn_[order[static_cast<std::size_t>(i)]];
    of_samples += weights_[i] * y * y.transpose();
  }
  covariance_ = (1 - rate_1 - rate_mu + (1 - stalled) * rate_1 * rate_c * (2 - rate_c)) * covariance_ +
                rate_1 * path_c_ * path_c_.transpose() + rate_mu * of_samples;
  sigma_ *= std::exp(rate_sigma / damping * (path_sigma_.norm() / expected - 1));

  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance_);
  const Eigen::VectorXd roots = eigen.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
  axes_ = eigen.eigenvectors() * roots.asDiagonal();
  inverse_root_ = eigen.eigenvectors() * roots.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  ++generation_;
}

std::vector<double> CmaEs::mean() const {
  const Eigen::VectorXd x = scaled(mean_);
  return {x.data(), x.data() + x.size()};
}

}  // namespace graupel::train
