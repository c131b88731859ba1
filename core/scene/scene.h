// The scene: domain, materials, particle sources, obstacles, time step and frames. SI units; y is up by convention.
// Read from JSON by io/scene_reader; docs/reference/scene_format.md is made from the declarations here.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/body.h"
#include "core/scene/domain.h"
#include "core/scene/emitter.h"
#include "core/scene/gravity.h"
#include "core/scene/load.h"
#include "core/scene/material_config.h"
#include "core/scene/motion.h"
#include "core/scene/particle_state.h"
#include "core/scene/region.h"
#include "core/scene/time_step_config.h"
#include "core/scene/transfer_config.h"

namespace graupel {

/// A body of material at the start.
struct Source : Body {
  std::string material;  ///< key of `materials`
  Sampling sampling = Sampling::random;
  double particles_per_cell = 8;
  Vec3d velocity = {0, 0, 0};          ///< initial, of the spin's centre [m/s]
  Vec3d angular_velocity = {0, 0, 0};  ///< initial [rad/s]
  std::optional<Vec3d> spin_center;    ///< [m]; default `position`
  std::optional<Motion> motion;        ///< a script that all its particles follow
  std::optional<double> release_time;  ///< [s]; then the particles are free
  /// Set by with_particles() (library/particle_state.h): what its points carry, in place of the members above.
  std::shared_ptr<const ParticleState> state;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = Source;
    Body::body_fields<S>(visit, "box half_box sphere half_sphere cone pyramid cylinder mesh points");
    visit(&S::material, FieldInfo{"material", "", "Key of the scene's materials"}.mandatory());
    visit(&S::sampling, FieldInfo{"sampling", "", "How particles are placed (not for points)"});
    visit(&S::particles_per_cell,
          FieldInfo{"particles_per_cell", "", "Particles in a grid cell", {.low = 0, .high = 1000, .low_open = true}});
    visit(&S::velocity, FieldInfo{"velocity", "m/s", "Initial velocity"});
    visit(&S::angular_velocity, FieldInfo{"angular_velocity", "rad/s", "Initial spin, about spin_center"});
    visit(&S::spin_center, FieldInfo{"spin_center", "m", "Centre of the spin; default the source's position"});
    visit(&S::motion, FieldInfo{"motion", "", "Script that its particles follow instead of the forces; {} holds them"});
    visit(&S::release_time,
          FieldInfo{"release_time", "s", "When scripted particles become free; default never", Range::not_negative()});
  }
};

/// A rigid obstacle, at rest or moved by a script.
struct Obstacle : Body {
  Contact contact = Contact::separate;
  double friction = 0;           ///< Coulomb coefficient
  std::optional<Motion> motion;  ///< at rest without one

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using O = Obstacle;
    Body::body_fields<O>(visit, "box half_box sphere half_sphere cone pyramid cylinder plane mesh vdb");
    visit(&O::contact, FieldInfo{"contact", "", "What the surface does to material that touches it"});
    visit(&O::friction,
          FieldInfo{"friction", "", "Coulomb friction coefficient (slip and separate)", Range::not_negative()});
    visit(&O::motion, FieldInfo{"motion", "", "Scripted motion; at rest without one"});
  }
};

/// Beyond this and gravity_range no step is short enough to keep positions within the range of numbers [s].
inline constexpr Range frame_time_range = {.low = 0, .high = 1e6, .low_open = true};

struct Scene {
  std::string name;
  std::string description;
  uint64_t seed = 0;  ///< of the particle sampling; --seed overrides it
  Domain domain;
  Vec3d gravity = {0, -9.8, 0};  ///< at time 0 [m/s^2]
  std::vector<GravityKey> gravity_keyframes;
  std::vector<TimedLoad> loads;
  std::map<std::string, MaterialConfig> materials;
  std::vector<Source> sources;
  std::vector<KinematicRegion> kinematic_regions;
  std::vector<Emitter> emitters;
  std::vector<Sink> sinks;
  std::vector<Obstacle> obstacles;
  std::optional<double> obstacle_voxel;  ///< [m]; default dx/2
  std::optional<double> obstacle_band;   ///< [m]; default max(4 dx, 0.1)
  bool push_out = true;                  ///< project particles out of obstacles after each substep
  TransferConfig transfer;
  TimeStep time_step;
  int64_t frames = 300;          ///< frames after the first; a trajectory has frames + 1
  double frame_time = 1.0 / 60;  ///< [s]

  std::string file;    ///< where it was read from; "" when made in memory
  std::string source;  ///< the JSON text, stored with every trajectory

  double voxel() const { return obstacle_voxel.value_or(domain.dx / 2); }
  double band() const { return obstacle_band.value_or(4 * domain.dx > 0.1 ? 4 * domain.dx : 0.1); }
  /// Lower and upper corner of the box that holds the material [m].
  Vec3d wall_low() const { return domain.wall_low(); }
  Vec3d wall_high() const { return domain.wall_high(); }
  /// Whether particles may be out of the run for a part of it.
  bool has_inactive_particles() const { return !emitters.empty() || !sinks.empty() || domain.has_wall(Wall::open); }
  bool has_changing_gravity() const { return !gravity_keyframes.empty(); }
  Vec3d gravity_at(double time) const { return graupel::gravity_at(gravity, gravity_keyframes, time); }
  /// Largest magnitude of gravity at any time [m/s^2].
  double largest_gravity() const { return graupel::largest_gravity(gravity, gravity_keyframes); }
  bool has_moving_obstacles() const {
    for (const Obstacle& obstacle : obstacles)
      if (obstacle.motion) return true;
    return false;
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = Scene;
    visit(&S::name, FieldInfo{"name", "", "Short name, used in file names and tables"});
    visit(&S::description, FieldInfo{"description", "", "What the scene shows"});
    visit(&S::domain, FieldInfo{"domain", "", "Domain, grid and walls"});
    visit(&S::gravity, FieldInfo{"gravity", "m/s^2", "Gravity; with gravity_keyframes that at time 0", gravity_range});
    visit(&S::gravity_keyframes,
          FieldInfo{"gravity_keyframes", "", "Gravity at later times, with straight lines between them"});
    visit(&S::loads, FieldInfo{"loads", "", "Forces on the matter in a ball, for a time"});
    visit(&S::materials, FieldInfo{"materials", "", "Materials by name"}.mandatory());
    visit(&S::sources, FieldInfo{"sources", "", "Bodies of material at the start"}.mandatory());
    visit(&S::kinematic_regions,
          FieldInfo{"kinematic_regions", "", "Particles that follow a script, by where they are at the start"});
    visit(&S::emitters, FieldInfo{"emitters", "", "Bodies that send out material during the run"});
    visit(&S::sinks, FieldInfo{"sinks", "", "Regions that remove particles"});
    visit(&S::obstacles, FieldInfo{"obstacles", "", "Rigid obstacles"});
    visit(&S::obstacle_voxel,
          FieldInfo{"obstacle_voxel", "m", "Voxel size of the obstacles' signed-distance grids; default dx/2",
                    Range::positive()});
    visit(&S::obstacle_band, FieldInfo{"obstacle_band", "m", "Half width of their narrow band; default max(4 dx, 0.1)",
                                       Range::positive()});
    visit(&S::push_out,
          FieldInfo{"push_out", "", "Move particles that entered an obstacle back to its surface after each substep"});
    visit(&S::transfer, FieldInfo{"transfer", "", "Transfers between particles and grid"});
    visit(&S::time_step, FieldInfo{"time_step", "", "Step size"});
    visit(&S::seed, FieldInfo{"seed", "", "Seed of the particle sampling"});
    visit(&S::frames, FieldInfo{"frames", "", "Frames after the first", Range::between(0, 1e6)});
    visit(&S::frame_time, FieldInfo{"frame_time", "s", "Time between frames", frame_time_range});
  }
};

}  // namespace graupel
