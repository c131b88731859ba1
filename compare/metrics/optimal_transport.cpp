#include "compare/metrics/optimal_transport.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace graupel::compare {

WeightedPoints bin_points(const std::vector<Vec3d>& position, const std::vector<double>& mass, double cell) {
  struct Bin {
    double mass = 0;
    Vec3d moment = {0, 0, 0};
  };
  std::map<std::array<int64_t, 3>, Bin> bins;
  double total = 0;
  for (std::size_t i = 0; i < position.size(); ++i) {
    std::array<int64_t, 3> key;
    for (int d = 0; d < 3; ++d) key[d] = static_cast<int64_t>(std::floor(position[i][d] / cell));
    Bin& bin = bins[key];
    bin.mass += mass[i];
    bin.moment += position[i] * mass[i];
    total += mass[i];
  }
  WeightedPoints points;
  for (const auto& [key, bin] : bins) {
    points.position.push_back(bin.moment * (1 / bin.mass));
    points.weight.push_back(bin.mass / total);
  }
  return points;
}

double bin_together(const std::vector<Vec3d>& x, const std::vector<double>& x_mass, const std::vector<Vec3d>& y,
                    const std::vector<double>& y_mass, double start, std::size_t limit, WeightedPoints& a,
                    WeightedPoints& b) {
  for (double cell = start;; cell *= 2) {
    a = bin_points(x, x_mass, cell);
    b = bin_points(y, y_mass, cell);
    if (a.weight.size() <= limit && b.weight.size() <= limit) return cell;
  }
}

namespace {

using Matrix = Eigen::Array<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Row = Eigen::Array<double, 1, Eigen::Dynamic>;

Matrix squared_distances(const WeightedPoints& a, const WeightedPoints& b, const Space& space) {
  Matrix cost(a.weight.size(), b.weight.size());
  for (std::size_t i = 0; i < a.weight.size(); ++i)
    for (std::size_t j = 0; j < b.weight.size(); ++j)
      cost(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          norm2(space.difference(a.position[i], b.position[j]));
  return cost;
}

Row log_weights(const WeightedPoints& a) {
  return Eigen::Map<const Row>(a.weight.data(), static_cast<Eigen::Index>(a.weight.size())).log();
}

/// Softmin: f_i = -eps log sum_j exp(log b_j + (g_j - c_ij) / eps).
Row soft_minimum(const Matrix& cost, const Row& log_b, const Row& g, double eps) {
  const Row h = log_b + g / eps;
  Row f(cost.rows());
  for (Eigen::Index i = 0; i < cost.rows(); ++i) {
    const Row exponent = h - cost.row(i) / eps;
    const double peak = exponent.maxCoeff();
    f(i) = -eps * (peak + std::log((exponent - peak).exp().sum()));
  }
  return f;
}

/// eps from the squared size of the clouds down to the wanted one, a quarter at a time.
std::vector<double> entropy_schedule(double largest_cost, double eps) {
  std::vector<double> schedule;
  for (double e = std::max(largest_cost, eps); e > eps; e /= 4) schedule.push_back(e);
  return schedule;
}

constexpr int most_iterations = 500;

/// OT_eps(a, b) = <a, f> + <b, g> at the fixed point of f = softmin(g), g = softmin(f).
double transport_cost(const WeightedPoints& a, const WeightedPoints& b, double eps, const Space& space) {
  const Matrix cost = squared_distances(a, b, space), turned = cost.transpose();
  const Row log_a = log_weights(a), log_b = log_weights(b);
  Row f = Row::Zero(cost.rows()), g = Row::Zero(cost.cols());
  for (const double e : entropy_schedule(cost.maxCoeff(), eps)) {
    f = soft_minimum(cost, log_b, g, e);
    g = soft_minimum(turned, log_a, f, e);
  }
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const Row before = g;
    f = soft_minimum(cost, log_b, g, eps);
    g = soft_minimum(turned, log_a, f, eps);
    if ((g - before).abs().maxCoeff() < 1e-5 * eps) break;
  }
  return (log_a.exp() * f).sum() + (log_b.exp() * g).sum();
}

/// OT_eps(a, a): f = g, by averaged updates, which converge in a few iterations (Feydy et al. 2019, eq. 25).
double self_transport_cost(const WeightedPoints& a, double eps, const Space& space) {
  const Matrix cost = squared_distances(a, a, space);
  const Row log_a = log_weights(a);
  Row f = Row::Zero(cost.rows());
  for (const double e : entropy_schedule(cost.maxCoeff(), eps)) f = 0.5 * (f + soft_minimum(cost, log_a, f, e));
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const Row next = 0.5 * (f + soft_minimum(cost, log_a, f, eps));
    const double change = (next - f).abs().maxCoeff();
    f = next;
    if (change < 1e-6 * eps) break;
  }
  // With its exact partner the pair has a transport plan, and the value's error is of second order in that of f.
  return (log_a.exp() * (f + soft_minimum(cost, log_a, f, eps))).sum();
}

}  // namespace

double sinkhorn_divergence(const WeightedPoints& a, const WeightedPoints& b, double eps, const Space& space) {
  if (a.weight.empty() || b.weight.empty()) return 0;
  if (a.position == b.position && a.weight == b.weight) return 0;
  const double self = 0.5 * (self_transport_cost(a, eps, space) + self_transport_cost(b, eps, space));
  return std::max(0.0, transport_cost(a, b, eps, space) - self);
}

}  // namespace graupel::compare
