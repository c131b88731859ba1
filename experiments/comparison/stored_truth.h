// A truth that is read from a file: what trajectories do not store of their particles comes from the scene's sources.
#pragma once

#include "compare/metrics/particle_run.h"
#include "experiments/comparison/scene_tasks.h"
#include "experiments/models/start_state.h"

namespace graupel::experiments {

/// Mass and volume of stored particles: from the sources where they give the same particles, else the mean by material.
/// Throws InputError for particles that the scene does not make.
void attach_masses(const SceneTask& task, compare::ParticleRun& run);

/// Where the truth's particles start: as stored, but those that emitters will send out, of which a file stores neither
/// velocity nor time. Throws InputError for other particles than the scene's where it has emitters.
StartState start_of_stored(const SceneTask& task, const compare::ParticleRun& truth);

}  // namespace graupel::experiments
