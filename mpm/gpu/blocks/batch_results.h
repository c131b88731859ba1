// What the scenes of a batch have come to: a frame of each, and why one has stopped. `Batch` is a solver of many
// scenes.
#pragma once

#include <algorithm>
#include <string>
#include <type_traits>
#include <vector>

#include "core/scene/trajectory.h"
#include "core/system/error.h"
#include "mpm/gpu/blocks/step_control.h"
#include "mpm/particles/host_particles.h"
#include "mpm/solver/divergence.h"

namespace graupel::mpm {

/// Throws what ended a scene at `time` [s].
template <typename Batch>
[[noreturn]] void throw_stopped(const Batch& batch, int scene_number, double time) {
  const SceneProgress& c = batch.control(scene_number);
  const auto& setup = batch.setup(scene_number);
  const Scene& scene = setup.scene;
  if (c.phase == ScenePhase::too_stiff) {
    const double speed =
        scene.time_step.policy == StepPolicy::adaptive ? c.speed : setup.fastest(c.speed, time - c.elapsed);
    next_step(scene.time_step, scene.domain.dx, scene.frame_time, {speed, c.sound_speed, setup.diffusivity},
              scene.frame_time - c.elapsed);  // throws
  }
  const auto host = batch.particles();
  DivergedParticle bad;
  bad.index = c.bad_particle - batch.first_particle(scene_number);  // that one counts through all scenes
  bad.substeps = c.substeps;
  bad.dt = static_cast<double>(c.dt);
  bad.time = time;
  bad.before = {c.before_speed, c.before_sound, setup.diffusivity};
  bad.wave = fastest_at_rest(setup.material_configs);
  const auto slot = static_cast<std::size_t>(
      std::find(host.source_index.begin(), host.source_index.end(), c.bad_particle) - host.source_index.begin());
  bad.speed = static_cast<double>(norm(host.velocity.at(slot)));
  bad.internal = static_cast<double>(host.internal[slot]);
  throw_diverged(scene, setup.material_configs[static_cast<std::size_t>(host.material[slot])], bad);
}

/// The same as text, for a scene that stopped in the frame after `frames_done` whole ones.
template <typename Batch>
std::string why_stopped(const Batch& batch, int scene_number, int64_t frames_done) {
  const double begin = static_cast<double>(frames_done) * batch.setup(scene_number).scene.frame_time;
  try {
    throw_stopped(batch, scene_number, begin + batch.control(scene_number).elapsed);
  } catch (const DivergedError& error) {
    return error.what();
  }
}

/// By source_index, which counts through all scenes; empty while every one has all its particles.
template <typename Batch>
std::vector<uint8_t> active_of_scenes(const Batch& batch) {
  std::vector<uint8_t> active;
  for (int i = 0; i < batch.scene_count(); ++i) {
    const std::vector<uint8_t> own = batch.setup(i).lifecycle.active();
    if (own.empty()) continue;
    active.resize(static_cast<std::size_t>(batch.first_particle(batch.scene_count())), 1);
    std::copy(own.begin(), own.end(), active.begin() + batch.first_particle(i));
  }
  return active;
}

/// A frame of each scene, with the `wanted` fields in it, after `frames_done` of them.
template <typename Batch>
std::vector<ParticleFrame> frames_of_scenes(const Batch& batch, FieldSet wanted, int64_t frames_done) {
  const ParticleFrame all = batch.frame();
  const std::vector<uint8_t> active = active_of_scenes(batch);
  ParticleFields fields;
  if (!wanted.empty()) fields = fields_of(batch.particles(), wanted, active);
  std::vector<ParticleFrame> frames(static_cast<std::size_t>(batch.scene_count()));
  for (int i = 0; i < batch.scene_count(); ++i) {
    ParticleFrame& frame = frames[static_cast<std::size_t>(i)];
    const auto part = [&](const auto& values, int64_t components) {
      return std::decay_t<decltype(values)>(values.begin() + components * batch.first_particle(i),
                                            values.begin() + components * batch.first_particle(i + 1));
    };
    frame.time = static_cast<double>(frames_done) * batch.setup(i).scene.frame_time;
    frame.position = part(all.position, 1);
    frame.velocity = part(all.velocity, 1);
    if (batch.setup(i).lifecycle.has_presence()) set_active(frame, part(active, 1));
    for (const ParticleField field : all_particle_fields)
      if (wanted.contains(field)) frame.fields[field] = part(fields[field], info_of(field).components);
  }
  return frames;
}

}  // namespace graupel::mpm
