#include "rom/projection/projection.h"

#include "core/system/error.h"

namespace graupel::rom {

namespace {

Eigen::Map<Eigen::VectorXd> vector_of(std::vector<double>& values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

/// q <- argmin |g(X_s, q) - x_s|^2 from where the latent's velocity takes it; q' is the change over dt.
FitReport position(SampleField& field, const SampleMotion& motion, double dt, int iterations, LatentState& state) {
  const Eigen::VectorXd old = vector_of(state.latent);
  Eigen::VectorXd latent = old + dt * vector_of(state.velocity);
  const FitOptions fit{.iterations = iterations, .linearisation = Linearisation::once};
  const FitReport report = fit_latent(field, motion.after, motion.weight, fit, latent);
  state.last_step = dt;
  state.previous = state.latent;
  vector_of(state.velocity) = (latent - old) / dt;
  vector_of(state.latent) = latent;
  return report;
}

/// q' <- argmin |dg/dq(X_s, q) q' - v_s|^2, v_s = (x_s - g(X_s, q)) / dt; then q <- q + dt q', and with
/// `positions` q <- argmin |g(X_s, q) - x_s|^2 from there, by Gauss-Newton with backtracking.
FitReport velocity(SampleField& field, const SampleMotion& motion, double dt, int iterations, bool positions,
                   LatentState& state) {
  FitReport report =
      fit_velocity(field, state.latent.data(), (motion.after - motion.before) / dt, motion.weight, state.velocity);
  report.distance *= dt;
  vector_of(state.latent) += dt * vector_of(state.velocity);
  if (!positions) return report;
  Eigen::VectorXd latent = vector_of(state.latent);
  const FitOptions fit{.iterations = iterations, .search = LineSearch::backtracking};
  report = fit_latent(field, motion.after, motion.weight, fit, latent);
  vector_of(state.latent) = latent;
  return report;
}

}  // namespace

FitReport project(ProjectionKind kind, SampleField& field, const SampleMotion& motion, double dt, int iterations,
                  LatentState& state) {
  switch (kind) {
    case ProjectionKind::position:
      return position(field, motion, dt, iterations, state);
    case ProjectionKind::position_velocity:
      return velocity(field, motion, dt, iterations, true, state);
    case ProjectionKind::velocity:
      return velocity(field, motion, dt, iterations, false, state);
  }
  GRAUPEL_ASSERT(false);
  return {};
}

}  // namespace graupel::rom
