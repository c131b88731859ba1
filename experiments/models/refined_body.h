// Super-resolution of reduced models (`graupel rollout --refine`): the same motion with many more points than the model
// has particles.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/scene/trajectory.h"
#include "experiments/models/body_points.h"

namespace graupel::experiments {

/// Throws ConfigError when `times` points for each particle do not fit into so many bytes, or into a trajectory.
void check_refined_size(int64_t particles, int64_t times, uint64_t available);

class RefinedBody {
 public:
  /// `times` points in the volume of every particle of the scene, where the model's map puts them; between particles
  /// for models that know these alone. Throws ConfigError when they do not fit into memory.
  RefinedBody(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t times);
  /// Positions of all points.
  ParticleFrame frame(const rom::LatentState& state, double time) const { return points_->frame(state, time); }
  const std::vector<int32_t>& particle_type() const { return particle_type_; }

 private:
  std::unique_ptr<PointFrames> points_;
  std::vector<int32_t> particle_type_;
};

}  // namespace graupel::experiments
