#include "experiments/models/start_state.h"

#include <algorithm>
#include <utility>

#include "core/math/random.h"
#include "core/system/error.h"
#include "mpm/scene_variants.h"

namespace graupel::experiments {

StartState start_of(const Scene& scene, uint64_t seed) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  StartState start;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    const auto& material =
        scene.materials.at(particles.material_names[static_cast<std::size_t>(particles.material[p])]);
    start.particle_type.push_back(particle_type_of(material.model));
    start.position.push_back(particles.position[p].cast<float>());
    start.velocity.push_back(particles.velocity[p].cast<float>());
    start.volume.push_back(particles.volume[p]);
    start.mass.push_back(particles.volume[p] * material.density);
  }
  start.birth_time = particles.birth_time;
  return start;
}

namespace {

Vec3d within_walls(const Scene& scene, Vec3d x) {
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  for (int d = 0; d < 3; ++d) x[d] = std::clamp(x[d], low[d], high[d]);
  return x;
}

}  // namespace

void move_births(const Scene& scene, uint64_t seed, double distance, mpm::SampledParticles& particles) {
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    const Random random(seed, RandomPurpose::metric_subset, p);
    Vec3d direction;
    double unused;
    random.normal(0, 0, direction[0], direction[1]);
    random.normal(0, 1, direction[2], unused);
    if (scene.domain.is_plane()) direction[2] = 0;
    particles.position[p] = within_walls(scene, particles.position[p] + normalized(direction) * distance);
  }
}

Scene resting_scene(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& position) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  GRAUPEL_ASSERT(particles.position.size() == position.size());
  std::vector<std::vector<Vec3d>> points(scene.sources.size() + scene.emitters.size());
  for (std::size_t p = 0; p < position.size(); ++p)
    points[static_cast<std::size_t>(particles.source[p])].push_back(within_walls(scene, position[p].cast<double>()));
  Scene resting = mpm::scene_of_points(scene, std::move(points));
  for (Source& source : resting.sources) {
    source.velocity = Vec3d::zero();
    source.angular_velocity = Vec3d::zero();
  }
  return resting;
}

}  // namespace graupel::experiments
