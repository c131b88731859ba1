#include "experiments/rollout/rollout_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"

namespace graupel::experiments {

bool is_trajectory(const std::string& path) { return path.ends_with(".h5"); }

Trajectory chosen_header(const io::TrajectoryReader& reader, const RolloutOptions& options) {
  if (options.trajectory >= reader.count())
    throw ConfigError(fmt::format("--trajectory {} is not in '{}' (allowed: 0 to {})", options.trajectory,
                                  options.input, reader.count() - 1));
  Trajectory header = reader.header(static_cast<int>(options.trajectory));
  if (header.scene_json.empty())
    throw InputError("'" + options.input +
                     "' holds no scene, so its walls and obstacles are unknown. Give the scene file instead");
  return header;
}

Scene stored_scene(const Trajectory& header, const RolloutOptions& options) {
  return io::parse_stored_scene(header.scene_json, options.input, options.input, options.set);
}

SceneAndSeed scene_and_seed(const RolloutOptions& options) {
  if (is_trajectory(options.input)) {
    const io::TrajectoryReader reader(options.input);
    const Trajectory header = chosen_header(reader, options);
    return {stored_scene(header, options), header.seed};
  }
  Scene scene = io::read_scene(options.input, options.set);
  const uint64_t seed = options.common.seed_given ? options.common.seed : scene.seed;
  return {std::move(scene), seed};
}

void write_positions(const std::string& file, const Trajectory& trajectory) {
  io::TrajectoryWriteOptions write;
  write.velocity = false;
  io::TrajectoryWriter writer(file, trajectory, write);
  for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
  writer.finish(trajectory.diverged_at_frame);
}

namespace {

/// The scene's particles at rest or at their initial velocity, with a ballistic past.
RolloutStart start_from_scene(const RolloutOptions& options, int history) {
  RolloutStart start;
  start.scene = io::read_scene(options.input, options.set);
  start.seed = options.common.seed_given ? options.common.seed : start.scene.seed;
  const mpm::SampledParticles particles = mpm::sample_sources(start.scene, start.seed);
  std::vector<Vec3f> position, velocity;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    position.push_back(particles.position[p].cast<float>());
    velocity.push_back(particles.velocity[p].cast<float>());
    start.particle_type.push_back(particle_type_of(
        start.scene.materials.at(particles.material_names[static_cast<std::size_t>(particles.material[p])]).model));
  }
  start.history = graph::start_history(position, velocity, start.scene.gravity, start.scene.frame_time, history,
                                       kinematic_mask(start.particle_type));
  return start;
}

/// Positions of usable frames from `first` on, at most `count` of them (-1: all).
std::vector<std::vector<Vec3f>> read_rest(const io::TrajectoryReader& reader, int index, const Trajectory& header,
                                          int64_t first, int64_t count) {
  int64_t usable = static_cast<int64_t>(header.frame_count());
  if (header.diverged_at_frame >= 0) usable = std::min(usable, header.diverged_at_frame);
  const int64_t there = std::max<int64_t>(0, usable - first);
  std::vector<std::vector<Vec3f>> positions;
  for (auto& frame : reader.frames(index, first, count < 0 ? there : std::min(there, count)))
    positions.push_back(std::move(frame.position));
  return positions;
}

/// "scene": frame 0 with a ballistic past; "truth:N": the first N frames of the trajectory.
RolloutStart start_from_trajectory(const RolloutOptions& options, int history) {
  const io::TrajectoryReader reader(options.input);
  const Trajectory header = chosen_header(reader, options);
  const int index = static_cast<int>(options.trajectory);
  RolloutStart start;
  start.scene = stored_scene(header, options);
  start.particle_type = header.particle_type;
  start.seed = header.seed;
  start.unknown_gravity = header.made_by.starts_with("converted from") && norm2(start.scene.gravity) == 0;
  start.rest = read_rest(reader, index, header, options.start == "scene" ? 1 : history, options.frames);
  if (options.start == "scene") {
    auto velocity = reader.initial_velocity(index);
    const auto first = reader.frames(index, 0, 1).front();
    if (velocity.empty()) velocity = first.velocity;
    if (velocity.empty())
      throw InputError("'" + options.input +
                       "' stores no velocity of the first frame. Use --start truth:" + std::to_string(history));
    start.history = graph::start_history(first.position, velocity, start.scene.gravity, start.scene.frame_time, history,
                                         kinematic_mask(start.particle_type));
    return start;
  }
  for (auto& frame : reader.frames(index, 0, history)) start.history.push_back(std::move(frame.position));
  return start;
}

}  // namespace

RolloutStart rollout_start(const RolloutOptions& options, int history) {
  return is_trajectory(options.input) ? start_from_trajectory(options, history) : start_from_scene(options, history);
}

}  // namespace graupel::experiments
