#include "mpm/scene_check.h"

#include <fmt/format.h>

#include "core/error.h"

namespace graupel::mpm {

namespace {

std::string text_of(const Vec3d& x) { return fmt::format("({:.5g}, {:.5g}, {:.5g})", x[0], x[1], x[2]); }

std::string name_of_source(const Scene& scene, int32_t index) {
  const Source& source = scene.sources[index];
  return fmt::format("source {} ({} of '{}')", index, word_of(source.shape), source.material);
}

}  // namespace

void check_start(const Scene& scene, const SampledParticles& particles, const sparsegrid::ObstacleSet& obstacles) {
  if (particles.position.empty())
    throw ConfigError("the scene has no particles. Add a source, or make one larger than a grid cell");
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  const double tolerance = 1e-6 * scene.domain.dx;
  for (std::size_t i = 0; i < particles.position.size(); ++i) {
    const Vec3d& x = particles.position[i];
    for (int d = 0; d < 3; ++d)
      if (!(x[d] >= low[d] - tolerance && x[d] <= high[d] + tolerance))
        throw ConfigError(
            fmt::format("{} reaches outside the walls (particle at {}, allowed: {} to {}). Move or shrink it, or "
                        "enlarge the domain",
                        name_of_source(scene, particles.source[i]), text_of(x), text_of(low), text_of(high)));
    if (obstacles.count() == 0) continue;
    int nearest = -1;
    const double phi = obstacles.sample(x, &nearest).phi;
    if (phi < -1e-4 * scene.domain.dx)
      throw ConfigError(fmt::format(
          "{} overlaps obstacle {} ({}): particle at {} lies {:.3g} m inside. Move the source or the obstacle",
          name_of_source(scene, particles.source[i]), nearest, word_of(scene.obstacles[nearest].shape), text_of(x),
          -phi));
  }
}

}  // namespace graupel::mpm
