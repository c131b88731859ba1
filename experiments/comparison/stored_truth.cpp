#include "experiments/comparison/stored_truth.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/scene/kinematic_particles.h"
#include "core/scene/material_config.h"
#include "core/system/error.h"

namespace graupel::experiments {

void attach_masses(const SceneTask& task, compare::ParticleRun& run) {
  const StartState sampled = start_of(task.scene, task.seed);
  if (sampled.particle_type == run.trajectory.particle_type) {
    run.mass = sampled.mass;
    run.volume = sampled.volume;
    return;
  }
  if (!kinematic_mask(run.trajectory.particle_type).empty())
    throw InputError(
        "a trajectory holds kinematic particles that its scene does not make (allowed: those of the scene). Data of "
        "other programs are compared with by `graupel rollout WEIGHTS DATA.h5 --start truth:N`");
  for (const int32_t type : run.trajectory.particle_type) {
    const auto same = std::find(sampled.particle_type.begin(), sampled.particle_type.end(), type);
    if (same == sampled.particle_type.end())
      throw InputError(fmt::format(
          "a trajectory holds particles of type {}, which its scene has not. Make the data set again; data of "
          "other programs are compared with by `graupel rollout WEIGHTS DATA.h5 --start truth:N`",
          particle_type_name(type)));
    const auto k = static_cast<std::size_t>(same - sampled.particle_type.begin());
    run.mass.push_back(sampled.mass[k]);
    run.volume.push_back(sampled.volume[k]);
  }
}

StartState start_of_stored(const SceneTask& task, const compare::ParticleRun& truth) {
  StartState start = start_of(task.scene, task.seed);
  const bool as_stored = start.particle_type == truth.trajectory.particle_type;
  if (!start.birth_time.empty() && !as_stored)
    throw InputError(fmt::format(
        "'{}' holds other particles than its scene's sources and emitters make ({}, {} of the scene). Make the data "
        "set again, or name the scene file",
        task.source, truth.size(), start.position.size()));
  if (!as_stored) start = {};
  start.particle_type = truth.trajectory.particle_type;
  start.mass = truth.mass;
  start.volume = truth.volume;
  start.position.resize(truth.size());
  start.velocity.resize(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!start.birth_time.empty() && start.birth_time[i] > 0) continue;
    start.position[i] = truth.position(0)[i];
    start.velocity[i] = task.initial_velocity[i];
  }
  if (!as_stored) add_schedule(task.scene, task.seed, start);
  return start;
}

}  // namespace graupel::experiments
