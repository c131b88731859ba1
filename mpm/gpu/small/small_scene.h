// Which scenes the kernel for small scenes runs, and in which of its two forms. Both depend on the scene alone, as its
// bytes must.
#pragma once

#include "core/scene/scripts.h"
#include "mpm/grid/grid.h"

namespace graupel::mpm {

/// Most nodes and particles of a small scene: 400 MB of grids; above, sorted blocks are faster
/// (docs/lab/performance.md).
inline constexpr int64_t most_small_nodes = int64_t{1} << 22;
inline constexpr int64_t most_small_particles = 16384;
/// Of one that changes, which has only the portable kernels above.
inline constexpr int64_t most_changing_particles = 262144;

/// Whether it has moving obstacles, particles that come and go or that scripts lead, or other transfers than APIC.
inline bool is_changing_scene(const Scene& scene) {
  return scene.has_moving_obstacles() || scene.has_inactive_particles() || has_scripts(scene) ||
         scene.transfer.scheme != TransferScheme::apic || scene.transfer.damping != 0;
}

/// Whether SmallSceneSolver runs a scene of this many particles.
inline bool is_small_scene(const Scene& scene, std::size_t particles) {
  const Vec<int, 3> blocks = grid_of<float>(scene.domain).blocks;
  int64_t nodes = 1;
  for (int d = 0; d < 3; ++d) nodes *= block_width * int64_t(blocks[d]);
  const int64_t most = is_changing_scene(scene) ? most_changing_particles : most_small_particles;
  return scene.time_step.policy != StepPolicy::adaptive && static_cast<int64_t>(particles) <= most &&
         nodes <= most_small_nodes && scene.obstacles.size() < 65000;
}

}  // namespace graupel::mpm
