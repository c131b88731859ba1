// What particles are besides material: not born yet or gone (emitters, sinks, open walls), or led by a script. Kept by
// the particles' place in the order of the sources, so that sorting does not touch it. Scenes without any of this have
// null pointers here.
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "core/scene/scene.h"
#include "mpm/particles/particles.h"
#include "mpm/particles/rigid_step.h"
#include "mpm/sampling.h"

namespace graupel::mpm {

enum class Presence : uint8_t { unborn = 0, active = 1, gone = 2 };

/// Home block of a particle that takes no part.
inline constexpr int32_t no_owner = -1;

template <typename T>
struct ScriptStep {
  RigidStep<T> motion;
  bool leads;  ///< false once the particles are released
};

/// For kernels.
template <typename T>
struct LifecycleView {
  Presence* presence;        ///< [n] null: all particles are active
  const double* birth_time;  ///< [n] [s]
  double step_end;           ///< [s]
  const Region* sinks;       ///< [sink_count]
  int32_t sink_count;
  const int32_t* script;       ///< [n] -1 for none; null: no particle has one
  const ScriptStep<T>* steps;  ///< of this substep

  GRAUPEL_HD bool is_active(int32_t particle) const {
    return presence == nullptr || presence[particle] == Presence::active;
  }
  /// The motion that leads a particle, or null.
  GRAUPEL_HD const RigidStep<T>* leader(int32_t particle) const {
    if (script == nullptr || script[particle] < 0 || !steps[script[particle]].leads) return nullptr;
    return &steps[script[particle]].motion;
  }
};

template <typename T>
class ParticleLifecycle {
 public:
  ParticleLifecycle() = default;
  ParticleLifecycle(Device device, const Scene& scene, const SampledParticles& sampled);

  bool has_scripts() const { return !scripts_.empty(); }
  bool has_presence() const { return presence_.size() > 0; }
  /// Sets the scripts' velocities for the substep of `dt` seconds from `time` on.
  void begin_step(double time, double dt);
  /// [scripts] these velocities.
  std::vector<ScriptStep<T>> script_steps(double time, double dt) const;
  LifecycleView<T> view() const;
  /// [n], 1 for active; empty where all particles always are.
  std::vector<uint8_t> active() const;
  /// Particles that came and went since the start.
  void count(int64_t& born, int64_t& removed) const;
  /// [n] or empty; for saving and loading.
  Buffer<Presence>& presence() { return presence_; }
  const Buffer<Presence>& presence() const { return presence_; }
  /// Largest speed that scripts and emitters give to particles at any time in [from, to] [m/s].
  double largest_speed(double from, double to) const;

 private:
  bool plane_ = false;  ///< a run of two dimensions
  std::vector<Script> scripts_;
  std::vector<double> reach_;  ///< largest distance of a particle from its script's centre [m]
  std::vector<Emitter> emitters_;
  double step_end_ = 0;
  Buffer<Presence> presence_;
  Buffer<double> birth_time_;
  Buffer<Region> sinks_;
  Buffer<int32_t> script_;
  Buffer<ScriptStep<T>> steps_;
};

}  // namespace graupel::mpm
