// Inversion of the deformation field (NSF eq. 10): the latent whose sample positions lie nearest to those that the grid
// has moved,
//   q = argmin sum_s w_s |g(X_s, q) - x_s|^2,
// by Gauss-Newton in f64. w_s is 0 for samples that are lost; 1 for all others, but for those in contact.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graupel::rom {

/// The deformation field at the samples.
class SampleField {
 public:
  virtual ~SampleField() = default;
  virtual int samples() const = 0;
  /// g(X_s, q) [m], [3 samples].
  virtual void evaluate(const double* latent, Eigen::VectorXd& position) const = 0;
  /// dg/dq [m], [3 samples, r].
  virtual void jacobian(const double* latent, Eigen::MatrixXd& jacobian) const = 0;

  /// From now on the normal equations have J = dg/dq of this latent.
  virtual void linearise(const double* latent) { jacobian(latent, jacobian_); }
  /// J^T W J [r, r] and J^T W residual [r], with one weight a sample.
  virtual void normal_equations(const std::vector<double>& weight, const Eigen::VectorXd& residual,
                                Eigen::MatrixXd& normal, Eigen::VectorXd& right) const;

 private:
  Eigen::MatrixXd jacobian_;
};

/// Where the Jacobian is taken.
enum class Linearisation {
  every_iteration,
  once  ///< at the first latent: enough for the short way of a time step
};

/// How far along its direction an iteration goes.
enum class LineSearch {
  none,         ///< all the way
  backtracking  ///< half as far again and again, until the squared distances fall by a quarter of what their slope
                ///< tells
};

struct FitOptions {
  int iterations = 3;       ///< at most; 1: the first-order inversion
  double tolerance = 1e-9;  ///< of the latent's change, relative to its size
  Linearisation linearisation = Linearisation::every_iteration;
  LineSearch search = LineSearch::none;
};

struct FitReport {
  int iterations = 0;
  double distance = 0;       ///< root of the weighted mean of |g(X_s, q) - x_s|^2 [m]
  double down_weighted = 0;  ///< share of samples that are lost
  double condition = 0;      ///< largest over smallest eigenvalue of J^T W J, estimated from its Cholesky factor
};

/// Improves `latent` from its value on entry. `weight` w [samples]; 0: the sample is lost and may not be finite; empty:
/// all 1. Throws DivergedError when more than half are lost, or the normal equations are singular or not finite.
FitReport fit_latent(SampleField& field, const Eigen::VectorXd& target, const std::vector<double>& weight,
                     const FitOptions& options, Eigen::VectorXd& latent);

/// q' = argmin sum_s w_s |dg/dq(X_s, q) q' - v_s|^2 (CROM eq. 28), which is linear; `velocity` v [3 samples] [m/s].
/// The report's distance is that of velocities [m/s]. Throws as fit_latent().
FitReport fit_velocity(SampleField& field, const double* latent, const Eigen::VectorXd& velocity,
                       const std::vector<double>& weight, std::vector<double>& rate);

}  // namespace graupel::rom
