#include "mpm/solver/divergence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "mpm/materials/material.h"
#include "mpm/physics/equal_substeps.h"

namespace graupel::mpm {

namespace {

/// What of a material has no masses or stresses in the run's precision; empty for none.
std::string beyond_precision(const MaterialConfig& material, double dx, double largest) {
  const double mass = material.density * dx * dx * dx;
  const auto parameters = material_parameters<double>(material);
  const double stiffness = std::max(parameters.bulk_modulus, parameters.lambda + 2 * parameters.mu);
  const bool is_mass = mass > 1 / largest && mass < largest;
  if (is_mass && stiffness < largest) return "";
  return fmt::format(
      "{} {:.4g} {} of material '{}' makes numbers that the run's precision does not hold ({:.1g} to {:.1g})",
      is_mass ? "the stiffness" : "density", is_mass ? stiffness : material.density, is_mass ? "Pa" : "kg/m^3",
      material.name, 1 / largest, largest);
}

/// "Use a step of at most ...", or which parameter leaves none.
std::string remedy(const Scene& scene, const MaterialConfig& material, const DivergedParticle& particle) {
  if (const std::string reason = beyond_precision(material, scene.domain.dx, particle.largest_number); !reason.empty())
    return fmt::format("No step helps: {}. Correct it", reason);
  StateSpeeds at_rest = particle.before;
  at_rest.sound_speed = particle.wave.speed;
  const double stable = usual_step(scene.domain.dx, at_rest);
  const double step = std::min(stable, suggested_step(scene.domain.dx, particle.before, particle.dt));
  if (!(scene.frame_time / step <= most_substeps))
    return fmt::format(
        "No step helps: the stable one, {:.3g} s, is taken over a million times a frame (elastic waves of material "
        "'{}' {:.4g} m/s, speed {:.4g} m/s, kinematic viscosity {:.4g} m^2/s). Lower the stiffness, the viscosity or "
        "the speed, or raise the density or dx",
        step, particle.wave.material, particle.wave.speed, at_rest.speed, at_rest.diffusivity);
  const std::string how =
      scene.time_step.policy == StepPolicy::adaptive
          ? fmt::format("time_step.max_step {:.4g}, or a time_step.courant below {:g}", step, scene.time_step.courant)
          : fmt::format("time_step.policy adaptive, or substeps_per_frame {}",
                        static_cast<int64_t>(std::ceil(scene.frame_time / step)));
  // A state that is about to break says little of its stable step; matter at rest gives a bound that is sure.
  if (step < stable)
    return fmt::format("Try a step of {:.4g} s or less (matter at rest needs at most {:.4g} s): {}", step,
                       std::min(stable, scene.frame_time), how);
  return fmt::format("Use a step of at most {:.4g} s (a Courant number of 0.3 for elastic waves at {:.4g} m/s): {}",
                     step, particle.wave.speed, how);
}

}  // namespace

RestingWave fastest_at_rest(const std::vector<MaterialConfig>& materials) {
  RestingWave fastest;
  for (const MaterialConfig& material : materials)
    if (const double speed = material_parameters<double>(material).elastic_speed; speed > fastest.speed)
      fastest = {speed, material.name};
  return fastest;
}

void throw_diverged(const Scene& scene, const MaterialConfig& material, const DivergedParticle& particle) {
  const double moved = particle.speed * particle.dt / scene.domain.dx;
  const bool volume_lost = internal_variable_is_volume_ratio(material.model) && !(particle.internal > 0);
  const std::string what = volume_lost ? fmt::format("its volume ratio is {:.4g}, allowed: above 0", particle.internal)
                           : std::isfinite(moved)
                               ? fmt::format("it would move {:.3g} cells in one substep, allowed: 1", moved)
                               : std::string("its state is not a number");
  throw DivergedError(fmt::format(
      "the simulation diverged at particle {} ({}, material '{}') in substep {} at t = {:.6g} s with a step of {:.4g} "
      "s ({}). {}",
      particle.index, particle_type_name(particle_type_of(material.model)), material.name, particle.substeps,
      particle.time, particle.dt, what, remedy(scene, material, particle)));
}

}  // namespace graupel::mpm
