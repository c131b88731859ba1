#include "experiments/rollout/rollout_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/scene/checks/frame_time_check.h"
#include "core/scene/materials_by_type.h"
#include "core/scene/scripts.h"
#include "core/system/error.h"
#include "experiments/data/stored_frames.h"
#include "experiments/models/start_state.h"
#include "experiments/process/input_file.h"
#include "io/scene/scene_reader.h"
#include "mpm/scene/particle_materials.h"

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
    check_readable(options.input);
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
  write.active = !trajectory.frames.front().active.empty();
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
  const StartState sampled = start_of(start.scene, start.seed);
  start.particle_type = sampled.particle_type;
  start.material = sampled.material;
  start.kept_materials = kept_materials(start.scene.materials, sampled.material);
  start.history = past_of(sampled, start.scene, history);
  start.schedule = schedule_of(sampled);
  return start;
}

/// Reads usable frames from `first` on, at most `count` of them (-1: all).
void read_rest(const io::TrajectoryReader& reader, const std::string& what, int index, const Trajectory& header,
               int64_t first, int64_t count, RolloutStart& start) {
  int64_t usable = static_cast<int64_t>(header.frame_count());
  if (header.diverged_at_frame >= 0) usable = std::min(usable, header.diverged_at_frame);
  const int64_t there = std::max<int64_t>(0, usable - first);
  std::vector<ParticleFrame> frames = reader.frames(index, first, count < 0 ? there : std::min(there, count));
  check_stored_frames(frames, first, what);
  for (auto& frame : frames) {
    start.rest.push_back(std::move(frame.position));
    start.rest_active.push_back(std::move(frame.active));
  }
}

/// Whether something of a scene happens at a time.
bool is_timed(const Scene& scene) {
  return scene.has_moving_obstacles() || !scene.emitters.empty() || has_scripts(scene);
}

/// "scene": frame 0 with a ballistic past; "truth:N": the first N frames of the trajectory.
RolloutStart start_from_trajectory(const RolloutOptions& options, int history, bool materials) {
  check_readable(options.input);
  const io::TrajectoryReader reader(options.input);
  const Trajectory header = chosen_header(reader, options);
  const int index = static_cast<int>(options.trajectory);
  if (header.frame_count() == 0)
    throw InputError(fmt::format("'{}': trajectory {} holds no frames. Name another", options.input, index));
  RolloutStart start;
  start.scene = stored_scene(header, options);
  const double frame_time = options.set.empty()
                                ? start.scene.frame_time
                                : io::parse_stored_scene(header.scene_json, options.input, options.input).frame_time;
  check_frame_time(header.frame_time, frame_time, fmt::format("'{}': trajectory {}", options.input, index));
  start.particle_type = header.particle_type;
  start.kept_materials = header.materials;
  start.seed = header.seed;
  start.unknown_gravity = header.made_by.starts_with("converted from") && norm2(start.scene.gravity) == 0;
  const bool from_scene = options.start == "scene";
  const auto there = static_cast<int64_t>(header.frame_count());
  if (!from_scene && (there < history || (there == history && options.frames < 0)))
    throw InputError(
        fmt::format("'{}': trajectory {} holds {} frames, and --start {} takes {} before the first that is predicted. "
                    "Give a longer "
                    "one{}",
                    options.input, index, there, options.start, history, there == history ? ", or --frames" : ""));
  const ParticleFrame first = reader.frames(index, 0, 1).front();
  if (materials)
    start.material = mpm::network_materials(start.scene, header, first.position,
                                            fmt::format("'{}': trajectory {}", options.input, index));
  StartState particles;
  particles.particle_type = start.particle_type;
  particles.position = first.position;
  particles.velocity = reader.initial_velocity(index);
  if (particles.velocity.empty()) particles.velocity = first.velocity;
  if (from_scene && particles.velocity.empty())
    throw InputError("'" + options.input +
                     "' stores no velocity of the first frame. Use --start truth:" + std::to_string(history));
  add_schedule(start.scene, start.seed, particles);
  start.schedule = schedule_of(particles);
  read_rest(reader, fmt::format("'{}': trajectory {}", options.input, index), index, header, from_scene ? 1 : history,
            options.frames, start);
  if (from_scene) {
    start.active = first.active;
    start.history = past_of(particles, start.scene, history);
    return start;
  }
  std::vector<ParticleFrame> frames = reader.frames(index, 0, history);
  check_stored_frames(frames, 0, fmt::format("'{}': trajectory {}", options.input, index));
  start.active = frames.back().active;
  for (ParticleFrame& frame : frames) start.history.push_back(std::move(frame.position));
  if (is_timed(start.scene)) start.time = (history - 1) * start.scene.frame_time;
  return start;
}

}  // namespace

RolloutStart rollout_start(const RolloutOptions& options, int history, bool materials) {
  return is_trajectory(options.input) ? start_from_trajectory(options, history, materials)
                                      : start_from_scene(options, history);
}

}  // namespace graupel::experiments
