// The particles of a scene at its start, and scenes that start from given particles.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/scene.h"
#include "graph/features/particle_schedule.h"
#include "mpm/sampling.h"

namespace graupel::experiments {

/// Particles of a scene, with the mass and volume of each: those of the start, and those that emitters send out later,
/// at the place and with the velocity of their birth.
struct StartState {
  std::vector<int32_t> particle_type;
  std::vector<int32_t> material;     ///< indices into scene.materials in map order
  std::vector<Vec3f> position;       ///< [m]
  std::vector<Vec3f> velocity;       ///< [m/s]
  std::vector<double> mass, volume;  ///< [kg], [m^3]
  std::vector<double> birth_time;  ///< [s]; those after 0 have the place and the velocity of it; empty without emitters
  std::vector<int32_t> script;     ///< index into scripts or -1; empty without scripts
  std::vector<mpm::Script> scripts;
};
StartState start_of(const Scene& scene, uint64_t seed);
/// Adds the births and scripts of a scene to a start whose particles are its sampled ones in other states. Those that
/// are born later have the velocity of their birth. Throws InputError where there is another number of particles.
void add_schedule(const Scene& scene, uint64_t seed, StartState& start);
/// [n] 1 for particles that are kinematic at `time` [s], by their type or by a script that has not released them; empty
/// where none are.
std::vector<uint8_t> kinematic_at(const StartState& start, double time);
/// Births and scripts, for networks.
graph::ParticleSchedule schedule_of(const StartState& start);
/// Positions of `frames` frames up to the start, oldest first: ballistic, but for particles that are kinematic or led
/// by a script, which rest where the script begins.
std::vector<std::vector<Vec3f>> past_of(const StartState& start, const Scene& scene, int frames);

/// Moves each particle's start, or place of birth, by `distance` [m] in a random direction, but not beyond the walls.
void move_births(const Scene& scene, uint64_t seed, double distance, mpm::SampledParticles& particles);

/// The scene with its particles as points at `position` [particles], at rest: a late state, without its stresses.
Scene resting_scene(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& position);

}  // namespace graupel::experiments
