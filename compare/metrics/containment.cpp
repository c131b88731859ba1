#include "compare/metrics/containment.h"

#include <algorithm>
#include <vector>

#include "core/parallel/parallel_for.h"
#include "core/scene/periodic_walls.h"

namespace graupel::compare {

namespace {

/// Distance to the nearest face of a box, negative outside.
double distance_inside_box(const Vec3d& x, const Vec3d& low, const Vec3d& high) {
  double distance = x[0] - low[0];
  for (int d = 0; d < 3; ++d) distance = std::min({distance, x[d] - low[d], high[d] - x[d]});
  return distance;
}

/// The corners of the walls that hold the material; far off where none does.
struct HoldingWalls {
  Vec3d low, high;
  explicit HoldingWalls(const Scene& scene) : low(scene.wall_low()), high(scene.wall_high()) {
    constexpr double far_off = 1e30;  // [m]
    for (int d = 0; d < 3; ++d)
      for (const int side : {0, 1}) {
        if (d >= scene.domain.axes() || !holds_material(scene.domain.wall(d, side)))
          (side == 0 ? low : high)[d] = side == 0 ? -far_off : far_off;
      }
  }
};

/// The obstacles where they are at a time.
class ObstaclesAt {
 public:
  ObstaclesAt(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, double time) : band_(scene.band()) {
    if (obstacles.count() == 0) return;
    if (!scene.has_moving_obstacles()) {
      view_ = obstacles.view();
      return;
    }
    moved_ = obstacles.views_at(time);
    view_ = {moved_.data(), static_cast<int>(moved_.size()), obstacles.cells()};
  }
  ObstaclesAt(const ObstaclesAt&) = delete;
  ObstaclesAt& operator=(const ObstaclesAt&) = delete;

  double distance(const Vec3d& x) const {
    int nearest = -1;
    return view_.count > 0 ? sparsegrid::signed_distance(view_, x, nearest).phi : band_;
  }

 private:
  double band_;
  std::vector<sparsegrid::ObstacleView> moved_;
  sparsegrid::ObstacleSetView view_{};
};

}  // namespace

Containment containment(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const ParticleRun& run) {
  const double tolerance = 1e-3 * scene.domain.dx;
  const HoldingWalls walls(scene);
  const Vec3d low = scene.domain.origin, high = scene.domain.origin + scene.domain.size;
  std::vector<Containment> frames(run.predicted());  // sums of one frame each, added up in order
  std::vector<int64_t> present(run.predicted(), 0);
  const auto one_frame = [&](int64_t k) {
    Containment& c = frames[k];
    const std::size_t f = static_cast<std::size_t>(k) + 1;
    const ObstaclesAt there(scene, obstacles, static_cast<double>(f) * run.trajectory.frame_time);
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (!run.is_active(f, i)) continue;
      ++present[k];
      const Vec3d x = run.position(f)[i].cast<double>();
      const double depth = std::max(0.0, -there.distance(x));
      c.mean_depth += depth;
      c.max_depth = std::max(c.max_depth, depth);
      c.inside_share += depth > tolerance;
      c.outside_walls += distance_inside_box(x, walls.low, walls.high) < -tolerance;
      c.most_outside_domain += distance_inside_box(x, low, high) < 0;
    }
  };
  parallel_for(Device::cpu, static_cast<int64_t>(frames.size()), one_frame, Grain{1});
  Containment total;
  double count = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const Containment& c = frames[k];
    count += static_cast<double>(present[k]);
    total.mean_depth += c.mean_depth;
    total.max_depth = std::max(total.max_depth, c.max_depth);
    total.inside_share += c.inside_share;
    total.outside_walls += c.outside_walls;
    total.most_outside_domain = std::max(total.most_outside_domain, c.most_outside_domain);
  }
  count = std::max(1.0, count);
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
    clearance[i] =
        std::min(distance_inside_box(x, low, high), obstacles.count() > 0 ? obstacles.sample(x).phi : scene.band());
  });
  return clearance;
}

}  // namespace graupel::compare
