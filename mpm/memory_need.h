// What a scene takes of memory at least, known before anything large is made: a scene that cannot fit is refused at
// once.
#pragma once

#include <cstdint>

#include "core/scene/scene.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Lower bounds. Grid nodes, obstacles and stored frames come on top.
struct MemoryNeed {
  double particles = 0;                     ///< of sources, and of emitters as far as their keys tell
  double blocks = 0;                        ///< of 4^3 nodes in the whole domain
  double host_bytes = 0, device_bytes = 0;  ///< the latter on a GPU; 0 without
};

/// Bytes of a particle on the host while a run is set up, on any device: as sampled (88) and in single precision.
inline constexpr double set_up_bytes = 236;

/// From the volumes of the bodies and the size of the domain.
MemoryNeed least_memory(const Scene& scene, const SimulationOptions& options);
/// For a known number of particles.
MemoryNeed least_memory(const Domain& domain, const SimulationOptions& options, double particles);
/// Of scenes that run at once.
MemoryNeed least_memory(const std::vector<PreparedScene>& scenes);

/// Throws ConfigError for more blocks in a domain than a directory numbers.
void check_block_count(double blocks);
/// Throws ConfigError when one of the two is less than what is needed [bytes].
void check_memory(const MemoryNeed& need, uint64_t available_on_host, uint64_t available_on_device);
/// With what there is now.
void check_memory(const MemoryNeed& need, Device device);

}  // namespace graupel::mpm
