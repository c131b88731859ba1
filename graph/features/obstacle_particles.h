// Obstacles as particles of a graph, the way of GNS: points on the obstacles' surfaces, of which those matter whose
// messages can reach a particle.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::graph {

/// Throws ConfigError where there are obstacles in a scene with two dimensions.
void check_obstacle_particles(const Scene& scene);

/// The obstacle particles of a scene, for any spacing; copies share them.
class ObstacleParticles {
 public:
  ObstacleParticles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles);

  /// Points on the surface of the union of obstacles inside the domain, no two closer than `spacing` [m], no hole over
  /// twice that. Made at the first call for a spacing; may be called from several threads. Throws as
  /// check_obstacle_particles().
  const std::vector<Vec3f>& at_spacing(double spacing) const;

 private:
  struct Cache;
  std::shared_ptr<Cache> cache_;
};

/// Numbers of those `points` that are no farther than `cutoff` [m] from some point of `particles`, ascending.
std::vector<int32_t> within_cutoff(const std::vector<Vec3f>& points, const std::vector<Vec3f>& particles,
                                   double cutoff);

}  // namespace graupel::graph
