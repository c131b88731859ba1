#include "rom/projection/gauss_newton.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

/// The samples' weights, their sum, and the share of those that are lost.
struct Weighing {
  std::vector<double> weight;
  double total = 0, lost = 0;

  Weighing(const std::vector<double>& given, int samples) : weight(given) {
    if (weight.empty()) weight.assign(static_cast<std::size_t>(samples), 1.0);
    for (const double w : weight) total += w;
    if (samples > 0) lost = static_cast<double>(std::count(weight.begin(), weight.end(), 0.0)) / samples;
  }

  /// sum_s w_s |r_s|^2.
  double squares(const Eigen::VectorXd& residual) const {
    double sum = 0;
    for (std::size_t s = 0; s < weight.size(); ++s)
      sum += weight[s] * residual.segment<3>(3 * static_cast<Eigen::Index>(s)).squaredNorm();
    return sum;
  }
  double root_mean(double squares) const { return total > 0 ? std::sqrt(std::max(0.0, squares) / total) : 0; }
};

}  // namespace

void SampleField::normal_equations(const std::vector<double>& weight, const Eigen::VectorXd& residual,
                                   Eigen::MatrixXd& normal, Eigen::VectorXd& right) const {
  normal.setZero(jacobian_.cols(), jacobian_.cols());
  right.setZero(jacobian_.cols());
  if (jacobian_.rows() == 0) return;  // of which Eigen would take the first number
  Eigen::MatrixXd weighted = jacobian_;
  for (std::size_t s = 0; s < weight.size(); ++s) weighted.middleRows(3 * static_cast<Eigen::Index>(s), 3) *= weight[s];
  // Half of the symmetric product, which Eigen does not share between threads: these would take longer to meet.
  normal.triangularView<Eigen::Lower>() = weighted.transpose() * jacobian_;
  normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
  right.noalias() = weighted.transpose() * residual;
}

namespace {

void refuse_lost(const Weighing& weighing) {
  if (weighing.lost > 0.5)
    throw DivergedError(
        "more than half of the samples of the reduced model move over one cell in a step, or are not finite. Use a "
        "smaller time step factor, more samples, or parameters nearer to those of the training");
}

/// What is lost may not be finite.
void drop_lost(const Weighing& weighing, Eigen::VectorXd& residual) {
  for (std::size_t s = 0; s < weighing.weight.size(); ++s)
    if (weighing.weight[s] == 0) residual.segment<3>(3 * static_cast<Eigen::Index>(s)).setZero();
}

/// The solution of the normal equations at the field's linearisation; `slope` is their right side.
Eigen::VectorXd solve_normal_equations(const SampleField& field, const Weighing& weighing,
                                       const Eigen::VectorXd& residual, Eigen::VectorXd& slope, FitReport& report) {
  constexpr double ridge = 1e-12;  ///< of the mean diagonal
  Eigen::MatrixXd normal;
  field.normal_equations(weighing.weight, residual, normal, slope);
  normal.diagonal().array() += ridge * normal.trace() / static_cast<double>(normal.rows());
  const Eigen::LLT<Eigen::MatrixXd> factor(normal);
  Eigen::VectorXd change = factor.solve(slope);
  if (factor.info() != Eigen::Success || !change.allFinite())
    throw DivergedError(
        "the inversion of the deformation field failed (its normal equations are singular or not finite). Use more "
        "samples, a smaller time step factor, or parameters nearer to those of the training");
  const auto diagonal = factor.matrixLLT().diagonal();
  report.condition = std::pow(diagonal.maxCoeff() / diagonal.minCoeff(), 2);
  return change;
}

}  // namespace

FitReport fit_latent(SampleField& field, const Eigen::VectorXd& target, const std::vector<double>& weight,
                     const FitOptions& options, Eigen::VectorXd& latent) {
  constexpr int most_halvings = 40;
  constexpr double sufficient = 0.25;  ///< of the decrease that the slope tells (Armijo)
  FitReport report;
  const Weighing weighing(weight, field.samples());
  refuse_lost(weighing);
  Eigen::VectorXd position, residual, slope;
  const auto residual_at = [&](const Eigen::VectorXd& at) {
    field.evaluate(at.data(), position);
    Eigen::VectorXd left = target - position;
    drop_lost(weighing, left);
    return left;
  };
  residual = residual_at(latent);
  while (report.iterations < options.iterations) {
    if (report.iterations == 0 || options.linearisation == Linearisation::every_iteration)
      field.linearise(latent.data());
    Eigen::VectorXd change = solve_normal_equations(field, weighing, residual, slope, report);
    const double before = weighing.squares(residual);
    Eigen::VectorXd left = residual_at(latent + change);
    if (options.search == LineSearch::backtracking)
      for (int h = 0; h < most_halvings && !(weighing.squares(left) <= before - 2 * sufficient * slope.dot(change));
           ++h) {
        change /= 2;
        left = residual_at(latent + change);
      }
    latent += change;
    residual = std::move(left);
    ++report.iterations;
    if (change.norm() <= options.tolerance * (1 + latent.norm())) break;
  }
  report.down_weighted = weighing.lost;
  report.distance = weighing.root_mean(weighing.squares(residual));
  return report;
}

FitReport fit_velocity(SampleField& field, const double* latent, const Eigen::VectorXd& velocity,
                       const std::vector<double>& weight, std::vector<double>& rate) {
  const Weighing weighing(weight, field.samples());
  refuse_lost(weighing);
  Eigen::VectorXd residual = velocity, slope;
  drop_lost(weighing, residual);
  FitReport report;
  report.iterations = 1;
  field.linearise(latent);
  const Eigen::VectorXd q = solve_normal_equations(field, weighing, residual, slope, report);
  rate.assign(q.data(), q.data() + q.size());
  // At the least squares' solution |v - J q'|^2 = |v|^2 - (J^T W v) . q', with squares weighted by W.
  report.down_weighted = weighing.lost;
  report.distance = weighing.root_mean(weighing.squares(residual) - slope.dot(q));
  return report;
}

}  // namespace graupel::rom
