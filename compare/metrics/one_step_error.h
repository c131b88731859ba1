// One-step error: acceleration of the next frame against the truth's, in frame units a = x(n+1) - 2 x(n) + x(n-1) [m].
// Reported beside two predictors that know nothing: a = 0 (constant velocity) and a = g dt^2 (ballistic flight), and
// split by what the particle is doing.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::compare {

enum class ParticleState {
  airborne,       ///< |a* - g dt^2| < 0.05 |g| dt^2: nothing but gravity acts
  near_obstacle,  ///< not airborne, and closer than 2 dx to an obstacle or a wall
  bulk            ///< the rest
};

/// x_next - 2 x_now + x_before [m], shape [n].
std::vector<Vec3d> frame_accelerations(const std::vector<Vec3f>& before, const std::vector<Vec3f>& current,
                                       const std::vector<Vec3f>& next);

/// Means over particles and frames of squared errors [m^2], axes summed.
struct OneStepError {
  double model = 0, zero = 0, ballistic = 0;
  double variance = 0;  ///< mean |a* - mean a*|^2 of the truth, at least (1e-4 dx)^2: the unit of the normalised errors
  std::array<double, 3> model_by_state = {0, 0, 0};  ///< by ParticleState; 0 where no particle was in that state
  std::array<double, 3> share = {0, 0, 0};           ///< of particle-frames by ParticleState
};

class OneStepAccumulator {
 public:
  OneStepAccumulator(const Vec3d& gravity, double frame_time, double dx);
  /// One frame: predicted and true accelerations, and each particle's distance to the nearest obstacle or wall [m].
  /// Particles that are `kinematic` ([n]; empty: none) do not count.
  void add(const std::vector<Vec3d>& predicted, const std::vector<Vec3d>& truth, const std::vector<double>& clearance,
           const std::vector<uint8_t>& kinematic = {});
  OneStepError result() const;
  ParticleState state_of(const Vec3d& acceleration, double clearance) const;

 private:
  Vec3d ballistic_;  ///< g dt^2 [m]
  double dx_;
  double count_ = 0, truth_squares_ = 0;
  Vec3d truth_sum_ = {0, 0, 0};
  double model_ = 0, zero_ = 0, fall_ = 0;
  std::array<double, 3> state_error_ = {0, 0, 0}, state_count_ = {0, 0, 0};
};

}  // namespace graupel::compare
