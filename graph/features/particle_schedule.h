// Which particles of a rollout are not there from the start, and which a script leads.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "core/parallel/host_device.h"
#include "core/scene/motion.h"

namespace graupel::graph {

/// A motion that some particles follow until they are released.
struct ParticleScript {
  Motion motion;
  Vec3d body_center;    ///< stands in for a centre that the motion does not give [m]
  double release_time;  ///< [s]; infinite: never
};

/// Position of a particle `seconds` after its birth at `place` [m] in ballistic flight, also before it.
GRAUPEL_HD inline Vec3f flight_since_birth(const Vec3f& place, const Vec3f& velocity, const Vec3d& gravity,
                                           double seconds) {
  return (place.cast<double>() + seconds * velocity.cast<double>() + (seconds * seconds / 2) * gravity).cast<float>();
}

/// Whether a particle that is seen at `time` [s] was not born yet at the time `then` before: it has a ballistic past.
GRAUPEL_HD inline bool was_born_between(double birth, double then, double time) {
  return birth > 0 && birth <= time && then < birth;
}

/// Of the n particles of a scene, in its order.
struct ParticleSchedule {
  std::vector<double> birth_time;     ///< [n] [s]; empty: all are there from the start
  std::vector<Vec3f> birth_velocity;  ///< [n] [m/s]; empty with birth_time
  std::vector<int32_t> script;        ///< [n] index into scripts or -1; empty without scripts
  std::vector<ParticleScript> scripts;
};

}  // namespace graupel::graph
