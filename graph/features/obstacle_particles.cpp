// within_cutoff looks at the cells of two cell lists first: most pairs of cells are wholly near or wholly far.
#include "graph/features/obstacle_particles.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "sparsegrid/cell_list.h"
#include "sparsegrid/cell_normals.h"

namespace graupel::graph {

namespace {

constexpr double cells_in_cutoff = 8;

/// Points of a cell and the box around them.
struct Group {
  int32_t begin, end;  ///< of CellList::point()
  Vec3d low, high;
};

std::vector<Group> groups_of(const sparsegrid::CellList& cells, const std::vector<Vec3f>& position) {
  std::vector<Group> groups;
  for (int32_t c = 0; c < cells.count(); ++c) {
    Group group = {cells.begin(c), cells.begin(c + 1), Vec3d::filled(1e30), Vec3d::filled(-1e30)};
    for (int32_t i = group.begin; i < group.end; ++i) {
      const auto p = static_cast<std::size_t>(cells.point()[static_cast<std::size_t>(i)]);
      const Vec3d x = position[p].cast<double>();
      for (int d = 0; d < 3; ++d) {
        group.low[d] = std::min(group.low[d], x[d]);
        group.high[d] = std::max(group.high[d], x[d]);
      }
    }
    groups.push_back(group);
  }
  return groups;
}

/// Squares of the least and the largest distance of points of two boxes.
struct BoxDistance {
  double least = 0, largest = 0;
  BoxDistance(const Group& a, const Group& b) {
    for (int d = 0; d < 3; ++d) {
      const double gap = std::max({0.0, a.low[d] - b.high[d], b.low[d] - a.high[d]});
      const double span = std::max(a.high[d] - b.low[d], b.high[d] - a.low[d]);
      least += gap * gap;
      largest += span * span;
    }
  }
};

}  // namespace

struct ObstacleParticles::Cache {
  Scene scene;  ///< domain and obstacles
  sparsegrid::ObstacleSet obstacles;
  std::mutex mutex;
  std::map<double, std::vector<Vec3f>> points;  ///< by spacing
};

void check_obstacle_particles(const Scene& scene) {
  if (scene.domain.is_plane() && !scene.obstacles.empty())
    throw ConfigError(
        "obstacles are made of particles in three dimensions only (gns.obstacle_particles true, domain.dimensions 2). "
        "Train with gns.obstacle_particles=false");
}

ObstacleParticles::ObstacleParticles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles)
    : cache_(std::make_shared<Cache>()) {
  cache_->scene.domain = scene.domain;
  cache_->scene.obstacles = scene.obstacles;
  cache_->obstacles = obstacles;
}

const std::vector<Vec3f>& ObstacleParticles::at_spacing(double spacing) const {
  const std::lock_guard<std::mutex> lock(cache_->mutex);
  check_obstacle_particles(cache_->scene);
  const auto [entry, is_new] = cache_->points.try_emplace(spacing);
  if (!is_new || cache_->obstacles.count() == 0) return entry->second;
  for (const Vec3d& x : sparsegrid::sample_surface(cache_->scene, cache_->obstacles, spacing).position)
    entry->second.push_back(x.cast<float>());
  return entry->second;
}

std::vector<int32_t> within_cutoff(const std::vector<Vec3f>& points, const std::vector<Vec3f>& particles,
                                   double cutoff) {
  std::vector<int32_t> near;
  if (points.empty() || particles.empty()) return near;
  const sparsegrid::CellList point_cells(points, cutoff / cells_in_cutoff),
      particle_cells(particles, cutoff / cells_in_cutoff);
  const std::vector<Group> point_groups = groups_of(point_cells, points),
                           particle_groups = groups_of(particle_cells, particles);
  const double cutoff2 = cutoff * cutoff;
  const auto is_near = [&](const Vec3f& x, const Group& group) {
    for (int32_t i = group.begin; i < group.end; ++i) {
      const auto p = static_cast<std::size_t>(particle_cells.point()[static_cast<std::size_t>(i)]);
      if (norm2(x.cast<double>() - particles[p].cast<double>()) <= cutoff2) return true;
    }
    return false;
  };
  std::vector<char> kept(points.size(), 0);
  parallel_for(
      Device::cpu, static_cast<int64_t>(point_groups.size()),
      [&](int64_t g) {
        const Group& group = point_groups[static_cast<std::size_t>(g)];
        std::vector<const Group*> doubtful;
        bool all = false;
        for (const Group& other : particle_groups) {
          const BoxDistance distance(group, other);
          all = distance.largest <= cutoff2;
          if (all) break;
          if (distance.least <= cutoff2) doubtful.push_back(&other);
        }
        for (int32_t i = group.begin; i < group.end; ++i) {
          const auto p = static_cast<std::size_t>(point_cells.point()[static_cast<std::size_t>(i)]);
          kept[p] = all || std::any_of(doubtful.begin(), doubtful.end(),
                                       [&](const Group* other) { return is_near(points[p], *other); });
        }
      },
      Grain{8});
  for (std::size_t p = 0; p < points.size(); ++p)
    if (kept[p]) near.push_back(static_cast<int32_t>(p));
  return near;
}

}  // namespace graupel::graph
