// The cheaper form of a scene that learned models are measured against: a coarser grid (fast_step.h has larger steps).
#include <algorithm>

#include "core/random.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

namespace {

/// One point at random of every `group`, or about as many, that follow one another: at 2 dx each stands for that many
/// times the volume.
std::shared_ptr<const std::vector<Vec3d>> one_of_each(std::size_t group, const std::vector<Vec3d>& points,
                                                      const Random& random) {
  std::vector<Vec3d> kept;
  const std::size_t n = points.size(), groups = n == 0 ? 0 : std::max<std::size_t>(1, (n + group / 2) / group);
  for (std::size_t g = 0; g < groups; ++g) {
    const std::size_t first = g * n / groups, end = (g + 1) * n / groups;
    kept.push_back(points[first + random.integer(g, 0, static_cast<uint32_t>(end - first))]);
  }
  return std::make_shared<const std::vector<Vec3d>>(std::move(kept));
}

}  // namespace

/// The walls stay where they are: the domain's faces move, so that the walls are again a whole number of cells inside.
Scene coarse_variant(const Scene& scene) {
  Scene coarse = scene;
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  coarse.domain.dx = 2 * scene.domain.dx;
  coarse.domain.wall_cells = std::max<int64_t>(2, (scene.domain.wall_cells + 1) / 2);
  const Vec3d margin = coarse.domain.wall_distance();
  coarse.domain.origin = low - margin;
  coarse.domain.size = high - low + 2.0 * margin;
  coarse.obstacle_voxel = scene.voxel();
  coarse.obstacle_band = std::max(scene.band(), 4 * coarse.domain.dx);
  coarse.time_step.substeps_per_frame = std::max<int64_t>(1, (scene.time_step.substeps_per_frame + 1) / 2);
  for (std::size_t s = 0; s < coarse.sources.size(); ++s) {
    Source& source = coarse.sources[s];
    if (source.shape == Shape::points && source.points)
      source.points = one_of_each(scene.domain.is_plane() ? 4 : 8, *source.points,
                                  Random(scene.seed, RandomPurpose::particle_position, s));
  }
  return coarse;
}

}  // namespace graupel::mpm
