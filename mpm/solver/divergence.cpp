#include "mpm/solver/divergence.h"

#include <fmt/format.h>

#include <cmath>

#include "core/system/error.h"
#include "mpm/materials/material.h"

namespace graupel::mpm {

void throw_diverged(const Scene& scene, const MaterialConfig& material, const DivergedParticle& particle) {
  const double moved = particle.speed * particle.dt / scene.domain.dx;
  const bool volume_lost = internal_variable_is_volume_ratio(material.model) && !(particle.internal > 0);
  const std::string what = volume_lost ? fmt::format("its volume ratio is {:.4g}, allowed: above 0", particle.internal)
                           : std::isfinite(moved)
                               ? fmt::format("it would move {:.3g} cells in one substep, allowed: 1", moved)
                               : std::string("its state is not a number");
  const double suggested = suggested_step(scene.domain.dx, particle.before, particle.dt);
  const std::string how = scene.time_step.policy == StepPolicy::adaptive
                              ? fmt::format("time_step.max_step {:.4g}, or a time_step.courant below {:g}", suggested,
                                            scene.time_step.courant)
                              : fmt::format("time_step.policy adaptive, or substeps_per_frame {}",
                                            static_cast<int64_t>(std::ceil(scene.frame_time / suggested)));
  throw DivergedError(fmt::format(
      "the simulation diverged at particle {} ({}, material '{}') in substep {} at t = {:.6g} s with a step of {:.4g} "
      "s ({}). Use a step of at most {:.4g} s: {}",
      particle.index, particle_type_name(particle_type_of(material.model)), material.name, particle.substeps,
      particle.time, particle.dt, what, suggested, how));
}

}  // namespace graupel::mpm
