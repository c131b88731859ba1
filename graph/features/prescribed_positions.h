// Places of kinematic particles in a learned rollout: those of obstacles and of the material "stationary"
// (core/scene/kinematic_particles.h), and those that a script leads until it releases them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "graph/features/particle_schedule.h"

namespace graupel::graph {

class PrescribedPositions {
 public:
  /// `given` [frames][n] holds the frames after the `start` [n]; null or too short: kinematic particles stay where they
  /// were last. Must live as long as this. Throws InputError for frames of another number of particles.
  PrescribedPositions(const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& start,
                      const std::vector<std::vector<Vec3f>>* given);
  /// Adds the scripts of a schedule, from the start at `start_time` [s] on, with frames `frame_time` [s] apart. Those
  /// in a plane keep their z.
  void add_scripts(const ParticleSchedule& schedule, double start_time, double frame_time, bool in_plane);

  const std::vector<Vec3f>& start() const { return start_; }
  bool any() const { return !prescribed_.empty() || !scripted_.empty(); }
  /// [n] 1 for the particles whose places are prescribed in `frame`, 1 for the first after the start; empty where there
  /// are none.
  std::vector<uint8_t> mask(int64_t frame) const;
  /// Puts them among `position` [n] to their places in that frame.
  void put(int64_t frame, std::vector<Vec3f>& position) const;

 private:
  struct Scripted {
    std::size_t particle;
    int32_t script;
  };
  double time_of(int64_t frame) const { return start_time_ + static_cast<double>(frame) * frame_time_; }
  bool leads(const ParticleScript& script, int64_t frame) const;

  std::vector<std::size_t> prescribed_;
  std::vector<Scripted> scripted_;
  std::vector<ParticleScript> scripts_;
  double start_time_ = 0, frame_time_ = 0;
  bool in_plane_ = false;
  std::vector<Vec3f> start_;  ///< [n]
  const std::vector<std::vector<Vec3f>>* given_;
};

}  // namespace graupel::graph
