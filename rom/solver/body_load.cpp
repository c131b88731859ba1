#include "rom/solver/body_load.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

void check_load(const Load& load) {
  const bool finite = std::isfinite(norm2(load.place)) && std::isfinite(norm2(load.force));
  if (!finite) throw ConfigError("the place or the force of a load is not finite. Give metres and newtons");
  if (!(load.radius > 0) || !std::isfinite(load.radius))
    throw ConfigError(
        fmt::format("a load's radius of {} m is out of range (above 0). Give that of the ball on which it "
                    "acts",
                    load.radius));
  if (!(load.duration > 0) || !std::isfinite(load.duration))
    throw ConfigError(fmt::format("a load's duration of {} s is out of range (above 0)", load.duration));
}

double distance_of(const Load& load, const Vec3f& x) { return std::sqrt(norm2(x.cast<double>() - load.place)); }

/// J^T W J and J^T W a of points with weights W and an acceleration a that is the same for all.
void sum_up(const SampleField& field, const std::vector<double>& mass, const double* latent, const Vec3d& a,
            Eigen::MatrixXd& matrix, Eigen::VectorXd& right) {
  Eigen::MatrixXd jacobian;
  field.jacobian(latent, jacobian);
  Eigen::VectorXd weight(jacobian.rows()), of_all(jacobian.rows());
  for (std::size_t s = 0; s < mass.size(); ++s)
    for (int d = 0; d < 3; ++d) {
      const auto row = static_cast<Eigen::Index>(3 * s) + d;
      weight[row] = mass[s];
      of_all[row] = mass[s] * a[d];
    }
  right = jacobian.transpose() * of_all;
  matrix = jacobian.transpose() * weight.asDiagonal() * jacobian;
}

}  // namespace

BodyLoad::Points BodyLoad::points_of(const Fields& fields, std::vector<int32_t> particles,
                                     const std::vector<double>& mass) {
  const std::size_t stride = (particles.size() + most_load_points - 1) / most_load_points;
  Points points;
  std::vector<int32_t> chosen;
  for (std::size_t first = 0; first < particles.size(); first += stride) {
    const std::size_t end = std::min(particles.size(), first + stride);
    chosen.push_back(particles[first + (end - first) / 2]);
    double sum = 0;
    for (std::size_t k = first; k < end; ++k) sum += mass[static_cast<std::size_t>(particles[k])];
    points.mass.push_back(sum);
    points.all += sum;
  }
  points.field = fields.bind_samples(chosen);
  return points;
}

bool BodyLoad::has_carriers(const Load& load, const std::vector<Vec3f>& position, const std::vector<double>& mass) {
  for (std::size_t p = 0; p < position.size(); ++p)
    if (mass[p] > 0 && distance_of(load, position[p]) <= load.radius) return true;
  return false;
}

BodyLoad::BodyLoad(const Fields& fields, const TimedLoad& load, const std::vector<Vec3f>& position,
                   const std::vector<double>& mass)
    : load_(load) {
  check_load(load);
  std::vector<int32_t> carriers, body;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < position.size(); ++p) {
    if (mass[p] == 0) continue;
    body.push_back(static_cast<int32_t>(p));
    const double distance = distance_of(load, position[p]);
    nearest = std::min(nearest, distance);
    if (distance <= load.radius) carriers.push_back(static_cast<int32_t>(p));
  }
  if (carriers.empty())
    throw ConfigError(fmt::format(
        "a load at ({:.4g}, {:.4g}, {:.4g}) m with radius {:.4g} m meets no matter that moves (the nearest is {:.4g} m "
        "away). Move it or give it a larger radius",
        load.place[0], load.place[1], load.place[2], load.radius, nearest));
  particles_ = static_cast<int64_t>(carriers.size());
  carriers_ = points_of(fields, std::move(carriers), mass);
  body_ = points_of(fields, std::move(body), mass);
}

void BodyLoad::equations(const double* latent, Eigen::VectorXd& right, Eigen::MatrixXd& matrix) const {
  Eigen::MatrixXd of_carriers;
  Eigen::VectorXd unused;
  sum_up(*carriers_.field, carriers_.mass, latent, (1 / carriers_.all) * load_.force, of_carriers, right);
  sum_up(*body_.field, body_.mass, latent, Vec3d::zero(), matrix, unused);
}

Eigen::VectorXd BodyLoad::acceleration(const double* latent) const {
  Eigen::VectorXd right;
  Eigen::MatrixXd matrix;
  equations(latent, right, matrix);
  const Eigen::LDLT<Eigen::MatrixXd> factor(matrix);
  Eigen::VectorXd acceleration = factor.solve(right);
  if (factor.info() != Eigen::Success || !acceleration.allFinite())
    throw DivergedError("a load meets a state whose mass matrix is singular. Use fewer latents");
  return acceleration;
}

LoadResponse BodyLoad::response(const double* latent) const {
  Eigen::VectorXd right;
  Eigen::MatrixXd matrix;
  equations(latent, right, matrix);
  const double alone = norm2(load_.force) / carriers_.all;  // twice the energy over the duration squared
  const double taken = right.dot(acceleration(latent));
  return {.particles = particles_, .share = alone > 0 ? std::clamp(taken / alone, 0.0, 1.0) : 0.0};
}

}  // namespace graupel::rom
