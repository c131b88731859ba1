// How a run of a reduced-order model begins, wherever it is stepped: the scene is checked, samples are chosen, and the
// latent is fitted to the scene's first state.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mpm/simulation.h"
#include "rom/reduced_model.h"

namespace graupel::rom {

/// A model of the deformation alone takes stress from F and has no affine velocity. Throws ConfigError for a scene with
/// other transfers than PIC, or with a law that has a plastic state.
void check_deformation_scene(const Scene& scene);

/// Throws ConfigError when the scene's particles are not those of the model, or it has what the model cannot know.
void check_start(const ReducedModel& model, const mpm::PreparedScene& prepared);

/// Steps over those of the training: `wanted`, else the model's. Throws ConfigError unless above 0.
double step_factor_of(const ReducedModel& model, const std::optional<double>& wanted);

/// `wanted`, else the model's; for a model of the deformation alone with at least five of every script.
std::vector<int32_t> samples_of_run(const ReducedModel& model, const std::optional<std::vector<int32_t>>& wanted,
                                    const mpm::SampledParticles& particles);

/// The latent of the scene's first state, and the velocity along the manifold that is nearest to its velocities.
LatentState start_of_run(const ReducedModel& model, const mpm::SampledParticles& particles,
                         std::vector<double> parameters);

}  // namespace graupel::rom
