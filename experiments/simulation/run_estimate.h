// What a run would need: particles, grid, substeps, memory, disk and time.
#pragma once

#include <string>

#include "core/scene/scene.h"
#include "experiments/simulation/simulate.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

/// Prints it, and writes it to --json. Memory and time are measured: at most 20 substeps of the scene, or half a
/// second, are run. Throws ConfigError, naming the scene's file, for a scene that cannot be run.
void print_run_estimate(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation);

/// What to know before a run that takes gigabytes for the empty part of its domain; "" for others.
std::string remark_on_memory(const Scene& scene, const mpm::SimulationOptions& simulation);

}  // namespace graupel::experiments
