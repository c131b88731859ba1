#include "experiments/models/start_state.h"

#include <fmt/format.h>

#include <utility>

#include "core/math/random.h"
#include "core/scene/kinematic_particles.h"
#include "core/scene/scripts.h"
#include "core/system/error.h"
#include "graph/learned_simulator.h"
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
  start.material = particles.material;
  start.birth_time = particles.birth_time;
  start.script = particles.script;
  start.scripts = particles.scripts;
  return start;
}

std::vector<uint8_t> kinematic_at(const StartState& start, double time) {
  std::vector<uint8_t> kinematic = kinematic_mask(start.particle_type);
  for (std::size_t i = 0; i < start.script.size(); ++i) {
    if (start.script[i] < 0 || time > start.scripts[static_cast<std::size_t>(start.script[i])].release_time) continue;
    kinematic.resize(start.script.size());
    kinematic[i] = 1;
  }
  return kinematic;
}

void add_schedule(const Scene& scene, uint64_t seed, StartState& start) {
  if (scene.emitters.empty() && !has_scripts(scene)) return;
  StartState sampled = start_of(scene, seed);
  if (sampled.position.size() != start.position.size())
    throw InputError(fmt::format(
        "the emitters and scripts of '{}' are of other particles than the trajectory's ({}, {} in the trajectory). Use "
        "a trajectory that `graupel simulate` made of this scene",
        scene.name, sampled.position.size(), start.position.size()));
  start.velocity.resize(start.position.size(), Vec3f::zero());
  for (std::size_t i = 0; i < sampled.birth_time.size(); ++i)
    if (sampled.birth_time[i] > 0) start.velocity[i] = sampled.velocity[i];
  start.birth_time = std::move(sampled.birth_time);
  start.script = std::move(sampled.script);
  start.scripts = std::move(sampled.scripts);
}

graph::ParticleSchedule schedule_of(const StartState& start) {
  graph::ParticleSchedule schedule;
  schedule.birth_time = start.birth_time;
  if (!start.birth_time.empty()) schedule.birth_velocity = start.velocity;
  schedule.script = start.script;
  for (const mpm::Script& script : start.scripts)
    schedule.scripts.push_back({script.motion, script.body_center, script.release_time});
  return schedule;
}

std::vector<std::vector<Vec3f>> past_of(const StartState& start, const Scene& scene, int frames) {
  std::vector<Vec3f> velocity = start.velocity;
  for (std::size_t i = 0; i < start.script.size(); ++i)
    if (start.script[i] >= 0) velocity[i] = Vec3f::zero();
  return graph::start_history(start.position, velocity, scene.gravity, scene.frame_time, frames,
                              kinematic_at(start, 0));
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
