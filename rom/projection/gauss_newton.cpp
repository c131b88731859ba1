#include "rom/projection/gauss_newton.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
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

FitReport fit_latent(SampleField& field, const Eigen::VectorXd& target, const std::vector<bool>& lost,
                     const FitOptions& options, Eigen::VectorXd& latent) {
  constexpr double ridge = 1e-12;  ///< of the mean diagonal
  FitReport report;
  if (2 * std::count(lost.begin(), lost.end(), true) > field.samples())
    throw DivergedError(
        "more than half of the samples of the reduced model move over one cell in a step, or are not finite. Use a "
        "smaller time step factor, more samples, or parameters nearer to those of the training");
  Eigen::VectorXd position, residual, right;
  Eigen::MatrixXd normal;
  const auto update_residual = [&] {
    field.evaluate(latent.data(), position);
    residual = target - position;
    for (std::size_t s = 0; s < lost.size(); ++s)
      if (lost[s]) residual.segment<3>(3 * static_cast<Eigen::Index>(s)).setZero();
  };
  update_residual();
  while (report.iterations < options.iterations) {
    const Weighing weighing(residual, lost);
    if (report.iterations == 0 || options.linearisation == Linearisation::every_iteration)
      field.linearise(latent.data());
    field.normal_equations(weighing.weight, residual, normal, right);
    normal.diagonal().array() += ridge * normal.trace() / static_cast<double>(normal.rows());
    const Eigen::LLT<Eigen::MatrixXd> factor(normal);
    const Eigen::VectorXd change = factor.solve(right);
    if (factor.info() != Eigen::Success || !change.allFinite())
      throw DivergedError(
          "the inversion of the deformation field failed (its normal equations are singular or not finite). Use more "
          "samples, a smaller time step factor, or parameters nearer to those of the training");
    const auto diagonal = factor.matrixLLT().diagonal();
    report.condition = std::pow(diagonal.maxCoeff() / diagonal.minCoeff(), 2);
    latent += change;
    ++report.iterations;
    update_residual();
    if (change.norm() <= options.tolerance * (1 + latent.norm())) break;
  }
  const Weighing last(residual, lost);
  report.down_weighted = last.down_weighted;
  report.distance = last.root_mean();
  return report;
}

}  // namespace graupel::rom
