// A force on the body of a reduced model while it runs. Matter in a ball carries it, in proportion to its mass. It
// drives the latents by Lagrange's equations of the body that the map constrains,
//   M q'' = J^T f,   M = sum_p m_p J_p^T J_p,   J = dg/dq,
// so it acts whatever samples the steps read.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/load.h"
#include "rom/fields/fields.h"

namespace graupel::rom {

/// What a model can make of a load.
struct LoadResponse {
  int64_t particles = 0;  ///< that carry it
  /// Share of the kinetic energy that its impulse would give them alone that goes into motions of the map: 0 where the
  /// map cannot follow at all, 1 where it can wholly.
  double share = 0;
  /// Speed of the latents after it over the fastest of the training, if nothing resisted; 0 where that is not known.
  double speed = 0;

  bool is_like_training() const { return speed <= 1; }
};

/// The particles of a body, at most so many of them, evenly chosen: a mass matrix needs no more.
inline constexpr std::size_t most_load_points = 4096;

class BodyLoad {
 public:
  /// Whether matter that moves by itself is in its ball; arguments as those of the constructor.
  static bool has_carriers(const Load& load, const std::vector<Vec3f>& position, const std::vector<double>& mass);
  /// `position` [n] [m] where the particles are at its start; `mass` [n] [kg], 0 for those that do not move by
  /// themselves. Throws ConfigError for a load without a radius, force or duration, and for a ball without matter.
  BodyLoad(const Fields& fields, const TimedLoad& load, const std::vector<Vec3f>& position,
           const std::vector<double>& mass);

  /// Seconds of [from, from + dt] in which it acts.
  double acts(double from, double dt) const { return load_.acts(from, dt); }
  bool is_over(double time) const { return time >= load_.end(); }
  /// q'' [r] [1/s^2] at a latent. Throws DivergedError where the map has no motion there.
  Eigen::VectorXd acceleration(const double* latent) const;
  /// At a latent; LoadResponse::speed is left to the caller.
  LoadResponse response(const double* latent) const;

 private:
  struct Points {
    std::unique_ptr<SampleField> field;
    std::vector<double> mass;  ///< that each stands for [kg]
    double all = 0;            ///< their sum
  };
  static Points points_of(const Fields& fields, std::vector<int32_t> particles, const std::vector<double>& mass);
  /// J^T f [r] and M [r, r].
  void equations(const double* latent, Eigen::VectorXd& right, Eigen::MatrixXd& matrix) const;

  TimedLoad load_;
  int64_t particles_ = 0;
  Points carriers_, body_;
};

}  // namespace graupel::rom
