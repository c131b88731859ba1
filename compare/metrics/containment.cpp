#include "compare/metrics/containment.h"

#include <algorithm>
#include <vector>

#include "core/parallel/parallel_for.h"

namespace graupel::compare {

namespace {

/// Distance to the nearest face of a box, negative outside.
double distance_inside_box(const Vec3d& x, const Vec3d& low, const Vec3d& high) {
  double distance = x[0] - low[0];
  for (int d = 0; d < 3; ++d) distance = std::min({distance, x[d] - low[d], high[d] - x[d]});
  return distance;
}

double obstacle_distance(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const Vec3d& x) {
  return obstacles.count() > 0 ? obstacles.sample(x).phi : scene.band();
}

}  // namespace

Containment containment(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const ParticleRun& run) {
  const double tolerance = 1e-3 * scene.domain.dx;
  const Vec3d wall_low = scene.wall_low(), wall_high = scene.wall_high();
  const Vec3d low = scene.domain.origin, high = scene.domain.origin + scene.domain.size;
  std::vector<Containment> frames(run.predicted());  // sums of one frame each, added up in order
  const auto one_frame = [&](int64_t k) {
    Containment& c = frames[k];
    for (const Vec3f& position : run.position(static_cast<std::size_t>(k) + 1)) {
      const Vec3d x = position.cast<double>();
      const double depth = std::max(0.0, -obstacle_distance(scene, obstacles, x));
      c.mean_depth += depth;
      c.max_depth = std::max(c.max_depth, depth);
      c.inside_share += depth > tolerance;
      c.outside_walls += distance_inside_box(x, wall_low, wall_high) < -tolerance;
      c.most_outside_domain += distance_inside_box(x, low, high) < 0;
    }
  };
  parallel_for(Device::cpu, static_cast<int64_t>(frames.size()), one_frame, Grain{1});
  Containment total;
  for (const Containment& c : frames) {
    total.mean_depth += c.mean_depth;
    total.max_depth = std::max(total.max_depth, c.max_depth);
    total.inside_share += c.inside_share;
    total.outside_walls += c.outside_walls;
    total.most_outside_domain = std::max(total.most_outside_domain, c.most_outside_domain);
  }
  const double count = std::max(1.0, static_cast<double>(run.size() * run.predicted()));
  total.mean_depth /= count;
  total.inside_share /= count;
  total.outside_walls /= count;
  return total;
}

std::vector<double> clearances(const Scene& scene, const sparsegrid::ObstacleSet& obstacles,
                               const std::vector<Vec3f>& position) {
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  std::vector<double> clearance(position.size());
  parallel_for(Device::cpu, static_cast<int64_t>(position.size()), [&](int64_t i) {
    const Vec3d x = position[i].cast<double>();
    clearance[i] = std::min(distance_inside_box(x, low, high), obstacle_distance(scene, obstacles, x));
  });
  return clearance;
}

}  // namespace graupel::compare
