// Places of kinematic particles (core/scene/kinematic_particles.h) in a learned rollout.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::graph {

class PrescribedPositions {
 public:
  /// `given` [frames][n] holds the frames after the `start` [n]; null or too short: kinematic particles stay where they
  /// were last. Must live as long as this. Throws InputError for frames of another number of particles.
  PrescribedPositions(const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& start,
                      const std::vector<std::vector<Vec3f>>* given);

  const std::vector<Vec3f>& start() const { return start_; }
  bool any() const { return !prescribed_.empty(); }
  /// Throws ConfigError where there are such particles, which rollouts on a GPU do not know.
  void refuse_gpu() const;
  /// Puts the kinematic ones among `position` [n] to their places in `frame`, 1 for the first after the start.
  void put(int64_t frame, std::vector<Vec3f>& position) const;

  /// The particles that are not kinematic, and their way back.
  std::vector<Vec3f> others(const std::vector<Vec3f>& position) const;
  void put_others(const std::vector<Vec3f>& others, std::vector<Vec3f>& position) const;

 private:
  std::vector<std::size_t> prescribed_, others_;
  std::vector<Vec3f> start_;  ///< [n]
  const std::vector<std::vector<Vec3f>>* given_;
};

}  // namespace graupel::graph
