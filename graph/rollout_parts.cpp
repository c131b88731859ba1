#include "graph/rollout_parts.h"

#include <algorithm>
#include <cmath>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"

namespace graupel::graph {

static bool about_equal(double a, double b) { return std::abs(a - b) <= 1e-3 * std::max(std::abs(a), std::abs(b)); }

void check_fit(const FeatureConfig& config, const Scene& scene, double normal_spacing, const std::string& file) {
  if (config.dimensions != scene.domain.dimensions)
    throw ConfigError("the network was trained for scenes with another number of dimensions (scene " +
                      std::to_string(scene.domain.dimensions) + ", '" + file + "' " +
                      std::to_string(config.dimensions) + "). Choose weights that were trained on such scenes");
  if (!about_equal(scene.frame_time, config.frame_time))
    throw ConfigError("the network was trained for another frame time (scene " + std::to_string(scene.frame_time) +
                      " s, '" + file + "' " + std::to_string(config.frame_time) +
                      " s). Set the scene's frame_time to that");
  if (config.cell_normal && !scene.obstacles.empty() && !about_equal(normal_spacing, config.dx))
    throw ConfigError("the network was trained with another cell size of the obstacle normals (scene " +
                      std::to_string(normal_spacing) + " m, '" + file + "' " + std::to_string(config.dx) +
                      " m). Set the scene's domain.dx to that");
}

void check_start(const std::vector<std::vector<Vec3f>>& start, std::size_t frames, std::size_t particles) {
  if (start.size() < frames)
    throw InputError("the start of the rollout has too few frames (" + std::to_string(start.size()) +
                     ", needed at least " + std::to_string(frames) + "). Give more frames or start from the scene");
  for (const auto& frame : start) {
    if (frame.size() != particles)
      throw InputError("a start frame has another number of particles (" + std::to_string(frame.size()) +
                       ", particle types " + std::to_string(particles) + "). Use frames of one trajectory");
    for (const Vec3f& x : frame)
      if (!std::isfinite(x[0] + x[1] + x[2]))
        throw InputError("a start position is not finite. Use an earlier frame of that trajectory");
  }
}

void check_schedule(const Scene& scene, const ParticleSchedule* schedule, std::size_t particles) {
  const bool emits = !scene.emitters.empty();
  const std::size_t births = schedule != nullptr ? schedule->birth_time.size() : 0,
                    scripts = schedule != nullptr ? schedule->script.size() : 0;
  if ((emits && births == 0) || (births != 0 && births != particles) || (scripts != 0 && scripts != particles))
    throw InputError("the schedule of the scene's particles is not of these particles (times of birth " +
                     std::to_string(births) + ", scripts " + std::to_string(scripts) + ", particles " +
                     std::to_string(particles) + "). Use the scene and the seed that made them");
}

std::string what_changes(const Environment& environment) {
  return environment.moves()         ? "its obstacles move"
         : environment.is_periodic() ? "it has periodic walls"
         : environment.plane         ? "it has two dimensions"
                                     : "";
}

std::string what_changes(const Environment& environment, const PrescribedPositions& prescribed,
                         const ParticleLifecycle& lifecycle) {
  return lifecycle.changes() ? "its particles come or go"
         : prescribed.any()  ? "it has kinematic particles"
                             : what_changes(environment);
}

std::vector<Vec3f> matter_at(const std::vector<Vec3f>& start, const std::vector<uint8_t>& kinematic,
                             const ParticleLifecycle& lifecycle) {
  std::vector<Vec3f> matter;
  for (std::size_t i = 0; i < start.size(); ++i)
    if ((kinematic.empty() || kinematic[i] == 0) && (!lifecycle.changes() || lifecycle.active()[i] != 0))
      matter.push_back(start[i]);
  return matter;
}

std::vector<Vec3f> falling(const Scene& scene, const std::vector<int32_t>& particle_type) {
  const Vec3f fall = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
  std::vector<Vec3f> acceleration(particle_type.size(), Vec3f::zero());
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    if (moves_by_itself(particle_type[i])) acceleration[i] = fall;
  return acceleration;
}

ParticleFrame make_frame(double time, double frame_time, std::span<const Vec3f> before, std::span<const Vec3f> current,
                         const std::vector<uint8_t>& active) {
  ParticleFrame frame;
  frame.time = time;
  frame.position.assign(current.begin(), current.end());
  frame.velocity.resize(current.size());
  const auto rate = static_cast<float>(1 / frame_time);
  for (std::size_t i = 0; i < current.size(); ++i)
    if (active.empty() || active[i] != 0) frame.velocity[i] = (current[i] - before[i]) * rate;
  frame.active = active;
  return frame;
}

Trajectory empty_trajectory(const Scene& scene, const std::vector<int32_t>& particle_type, const std::string& made_by) {
  Trajectory trajectory;
  trajectory.particle_type = particle_type;
  trajectory.frame_time = scene.frame_time;
  trajectory.scene_json = scene.source;
  trajectory.seed = scene.seed;
  trajectory.made_by = made_by;
  return trajectory;
}

}  // namespace graupel::graph
