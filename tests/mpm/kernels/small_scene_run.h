// SmallSceneSolver with fibers for threads, and how far its frames are from another run's.
#pragma once

#include "mpm/gpu/blocks/batch_results.h"
#include "mpm/gpu/blocks/batch_state.h"
#include "tests/mpm/kernels/fiber_backend.h"

namespace graupel::mpm {

using SmallSolver = SmallSceneSolver<FiberBackend>;

inline std::unique_ptr<SmallSolver> solver_of(FiberBackend& backend, const std::vector<Scene>& scenes,
                                              uint64_t seed = 3) {
  std::vector<BatchEntry> entries;
  for (const Scene& scene : scenes)
    entries.push_back({scene, sample_sources(scene, seed), sparsegrid::ObstacleSet(scene)});
  return std::make_unique<SmallSolver>(backend, std::move(entries));
}

struct Difference {
  float position = 0, velocity = 0;
};
inline Difference difference(const ParticleFrame& a, const ParticleFrame& b, std::size_t first = 0) {
  Difference worst;
  for (std::size_t i = 0; i < a.position.size(); ++i) {
    worst.position = std::max(worst.position, norm(a.position[i] - b.position[first + i]));
    worst.velocity = std::max(worst.velocity, norm(a.velocity[i] - b.velocity[first + i]));
  }
  return worst;
}

}  // namespace graupel::mpm
