#include "rom/projection/gauss_newton.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

/// Distances of the samples and their weights.
struct Weighing {
  std::vector<double> distance2, weight;
  double down_weighted = 0;

  Weighing(const Eigen::VectorXd& residual, const std::vector<bool>& lost) {
    const auto n = static_cast<std::size_t>(residual.size() / 3);
    distance2.resize(n);
    weight.assign(n, 1.0);
    std::size_t beyond = 0;
    for (std::size_t s = 0; s < n; ++s) {
      distance2[s] = residual.segment<3>(3 * static_cast<Eigen::Index>(s)).squaredNorm();
      if (lost.empty() || !lost[s]) continue;
      weight[s] = 0;
      ++beyond;
    }
    down_weighted = n > 0 ? static_cast<double>(beyond) / static_cast<double>(n) : 0;
  }

  double root_mean() const {
    double sum = 0, total = 0;
    for (std::size_t s = 0; s < weight.size(); ++s) {
      sum += weight[s] * distance2[s];
      total += weight[s];
    }
    return total > 0 ? std::sqrt(sum / total) : 0;
  }
};

}  // namespace

void SampleField::normal_equations(const std::vector<double>& weight, const Eigen::VectorXd& residual,
                                   Eigen::MatrixXd& normal, Eigen::VectorXd& right) const {
  Eigen::MatrixXd weighted = jacobian_;
  for (std::size_t s = 0; s < weight.size(); ++s) weighted.middleRows(3 * static_cast<Eigen::Index>(s), 3) *= weight[s];
  normal.noalias() = weighted.transpose() * jacobian_;
  right.noalias() = weighted.transpose() * residual;
}

namespace {

void refuse_lost(const std::vector<bool>& lost, int samples) {
  if (2 * std::count(lost.begin(), lost.end(), true) > samples)
    throw DivergedError(
        "more than half of the samples of the reduced model move over one cell in a step, or are not finite. Use a "
        "smaller time step factor, more samples, or parameters nearer to those of the training");
}

void drop_lost(const std::vector<bool>& lost, Eigen::VectorXd& residual) {
  for (std::size_t s = 0; s < lost.size(); ++s)
    if (lost[s]) residual.segment<3>(3 * static_cast<Eigen::Index>(s)).setZero();
}

/// The solution of the normal equations at the field's linearisation; `slope` is their right side.
Eigen::VectorXd solve_normal_equations(const SampleField& field, const Weighing& weighing,
                                       const Eigen::VectorXd& residual, Eigen::VectorXd& slope, FitReport& report) {
  constexpr double ridge = 1e-12;  ///< of the mean diagonal
  Eigen::MatrixXd normal;
  field.normal_equations(weighing.weight, residual, normal, slope);
  normal.diagonal().array() += ridge * normal.trace() / static_cast<double>(normal.rows());
  const Eigen::LLT<Eigen::MatrixXd> factor(normal);
  const Eigen::VectorXd change = factor.solve(slope);
  if (factor.info() != Eigen::Success || !change.allFinite())
    throw DivergedError(
        "the inversion of the deformation field failed (its normal equations are singular or not finite). Use more "
        "samples, a smaller time step factor, or parameters nearer to those of the training");
  const auto diagonal = factor.matrixLLT().diagonal();
  report.condition = std::pow(diagonal.maxCoeff() / diagonal.minCoeff(), 2);
  return change;
}

}  // namespace

FitReport fit_latent(SampleField& field, const Eigen::VectorXd& target, const std::vector<bool>& lost,
                     const FitOptions& options, Eigen::VectorXd& latent) {
  constexpr int most_halvings = 40;
  constexpr double sufficient = 0.25;  ///< of the decrease that the slope tells (Armijo)
  FitReport report;
  refuse_lost(lost, field.samples());
  Eigen::VectorXd position, residual, slope;
  const auto residual_at = [&](const Eigen::VectorXd& at) {
    field.evaluate(at.data(), position);
    Eigen::VectorXd left = target - position;
    drop_lost(lost, left);
    return left;
  };
  residual = residual_at(latent);
  while (report.iterations < options.iterations) {
    const Weighing weighing(residual, lost);
    if (report.iterations == 0 || options.linearisation == Linearisation::every_iteration)
      field.linearise(latent.data());
    Eigen::VectorXd change = solve_normal_equations(field, weighing, residual, slope, report);
    const double before = residual.squaredNorm();
    Eigen::VectorXd left = residual_at(latent + change);
    if (options.search == LineSearch::backtracking)
      for (int h = 0; h < most_halvings && !(left.squaredNorm() <= before - 2 * sufficient * slope.dot(change)); ++h) {
        change /= 2;
        left = residual_at(latent + change);
      }
    latent += change;
    residual = std::move(left);
    ++report.iterations;
    if (change.norm() <= options.tolerance * (1 + latent.norm())) break;
  }
  const Weighing last(residual, lost);
  report.down_weighted = last.down_weighted;
  report.distance = last.root_mean();
  return report;
}

FitReport fit_velocity(SampleField& field, const double* latent, const Eigen::VectorXd& velocity,
                       const std::vector<bool>& lost, std::vector<double>& rate) {
  refuse_lost(lost, field.samples());
  Eigen::VectorXd residual = velocity, slope;
  drop_lost(lost, residual);
  const Weighing weighing(residual, lost);
  FitReport report;
  report.iterations = 1;
  field.linearise(latent);
  const Eigen::VectorXd q = solve_normal_equations(field, weighing, residual, slope, report);
  rate.assign(q.data(), q.data() + q.size());
  // At the least squares' solution |v - J q'|^2 = |v|^2 - (J^T v) . q'.
  const auto counted = static_cast<double>(field.samples()) * (1 - weighing.down_weighted);
  report.down_weighted = weighing.down_weighted;
  report.distance = counted > 0 ? std::sqrt(std::max(0.0, residual.squaredNorm() - slope.dot(q)) / counted) : 0;
  return report;
}

}  // namespace graupel::rom
