// Which particles of a learned rollout are in the run: emitted ones appear at their time of birth, others leave by
// sinks and open walls. Particles that cross a periodic wall come in at the opposite one.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/scene.h"
#include "graph/features/features.h"
#include "graph/features/particle_schedule.h"

namespace graupel::graph {

class ParticleLifecycle {
 public:
  /// `active` [n] are those of the start at `start_time` [s]; empty: all that are born by then. `place` [n]: positions
  /// at the start, of particles that are not born yet those of their birth. `schedule` may be null. `scene` must live
  /// as long as this.
  ParticleLifecycle(const Scene& scene, const ParticleSchedule* schedule, const std::vector<Vec3f>& place,
                    const std::vector<uint8_t>& active, double start_time);

  /// Whether particles may come or go.
  bool changes() const { return !active_.empty(); }
  /// [n] 1 for those in the run; empty without changes().
  const std::vector<uint8_t>& active() const { return active_; }
  /// Those in the run, ascending. With changes() alone.
  const std::vector<int32_t>& present() const { return present_; }

  /// Lets particles that are born by the time of the newest of `history` (frames [n], newest last) appear: as if they
  /// had flown since their birth, and before it. Returns whether some did. `environment` is that of the newest frame.
  bool appear(const Environment& environment, std::vector<std::vector<Vec3f>>& history, double time);
  /// Takes out those that met a sink or an open wall between the last two frames, and moves those that crossed a
  /// periodic wall, in all frames. `kinematic` [n]: particles that pass sinks and walls; or empty. Returns whether some
  /// are gone.
  bool leave(const Environment& environment, const std::vector<uint8_t>& kinematic,
             std::vector<std::vector<Vec3f>>& history);

 private:
  void list_present();

  const Scene& scene_;
  const ParticleSchedule* schedule_;
  std::vector<uint8_t> active_;
  std::vector<int32_t> present_;
  std::vector<int32_t> unborn_;
  std::vector<Vec3f> birth_place_;  ///< [n]
};

/// Replaces the places that stored frames give for particles before their birth, that of the birth, by the ballistic
/// past of it. `positions` are frames [n], the newest at `time` [s].
void add_past_of_born(const Scene& scene, const ParticleSchedule& schedule, double time,
                      std::vector<std::vector<Vec3f>>& positions);

}  // namespace graupel::graph
