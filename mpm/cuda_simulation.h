// Simulations on a GPU with the tuned kernels: one scene, or many of them at once.
#pragma once

#include <memory>
#include <vector>

#include "mpm/sampling.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Scenes with their particles and obstacles, in single precision. Only where Graupel was built with CUDA.
std::unique_ptr<SceneBatch> make_cuda_batch(const std::vector<Scene>& scenes,
                                            const std::vector<SampledParticles>& particles,
                                            const std::vector<sparsegrid::ObstacleSet>& obstacles);

/// One scene in single precision. Only where Graupel was built with CUDA.
std::unique_ptr<Simulation> make_cuda_simulation(const Scene& scene, const SimulationOptions& options,
                                                 const SampledParticles& particles,
                                                 const sparsegrid::ObstacleSet& obstacles);

}  // namespace graupel::mpm
