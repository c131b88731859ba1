// Stands in for cuda_simulation.cu in a build without CUDA.
#include "core/system/error.h"
#include "mpm/cuda_simulation.h"

namespace graupel::mpm {

namespace {
[[noreturn]] void no_cuda() {
  throw ConfigError("device 'cuda' is not usable (this program was built without CUDA). Use device 'cpu'");
}
}  // namespace

std::unique_ptr<SceneBatch> make_cuda_batch(const std::vector<Scene>&, const std::vector<SampledParticles>&,
                                            const std::vector<sparsegrid::ObstacleSet>&) {
  no_cuda();
}

std::unique_ptr<Simulation> make_cuda_simulation(const Scene&, const SimulationOptions&, const SampledParticles&,
                                                 const sparsegrid::ObstacleSet&) {
  no_cuda();
}

}  // namespace graupel::mpm
