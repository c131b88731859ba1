// Small data sets of scenes that change: a box that turns on its way among particles, and a stream over a sink.
#pragma once

#include "graph/features/particle_schedule.h"
#include "mpm/sampling.h"
#include "tests/train/tiny_data.h"

namespace graupel::train {

inline const char* moving_box_scene() {
  return R"({
    "name": "box", "domain": {"size": [1, 1, 1], "dx": 0.03125, "wall_cells": 4},
    "materials": {"s": {"preset": "sand"}, "w": {"preset": "water"}},
    "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "w"}],
    "obstacles": [
      {"shape": "sphere", "radius": 0.1, "position": [0.6, 0.3, 0.5], "contact": "stick"},
      {"shape": "box", "size": [0.1, 0.2, 0.3], "position": [0.35, 0.35, 0.5], "contact": "separate", "friction": 0.3,
       "motion": {"velocity": [0.4, 0.1, 0], "spin": 4, "axis": [0, 0.5, 1]}}],
    "frames": 40, "frame_time": 0.016666666666666666
  })";
}

/// Two particles a frame, and a body that is there from the start; both fall into the sink.
inline const char* stream_scene() {
  return R"({
    "name": "stream", "domain": {"size": [1, 1, 1], "dx": 0.03125, "wall_cells": 4},
    "materials": {"w": {"preset": "water"}},
    "sources": [{"shape": "box", "size": [0.05, 0.05, 0.05], "position": [0.35, 0.5, 0.5], "material": "w"}],
    "emitters": [{"shape": "box", "size": [0.1, 0.02, 0.1], "position": [0.5, 0.7, 0.5], "material": "w",
                  "velocity": [0.3, -1, 0], "rate": 125, "start_time": 0.05, "end_time": 0.35}],
    "sinks": [{"shape": "box", "size": [1, 0.05, 1], "position": [0.5, 0.3, 0.5]}],
    "frames": 40, "frame_time": 0.016666666666666666
  })";
}

/// The particles of tiny_trajectory() in the scene of the box.
inline Trajectory moving_box_trajectory(uint64_t seed) {
  Trajectory trajectory = tiny_trajectory(seed, 24, 30);
  trajectory.scene_json = io::scene_to_json(io::parse_scene(moving_box_scene(), "box", "."));
  return trajectory;
}

/// A scene at rest, of water alone.
inline Trajectory resting_trajectory(uint64_t seed) {
  Trajectory trajectory = tiny_trajectory(seed, 24, 30);
  trajectory.particle_type.assign(trajectory.particle_type.size(), 5);
  return trajectory;
}

/// Ballistic flight from birth on, into the sink.
inline Trajectory stream_trajectory(uint64_t seed) {
  const Scene scene = io::parse_scene(stream_scene(), "stream", ".");
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, seed);
  constexpr float top_of_sink = 0.325f;
  Trajectory trajectory;
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = seed;
  trajectory.particle_type.assign(sampled.position.size(), 5);
  for (int t = 0; t < 40; ++t) {
    ParticleFrame frame;
    frame.time = t * scene.frame_time;
    for (std::size_t p = 0; p < sampled.position.size(); ++p) {
      const Vec3f place = sampled.position[p].cast<float>(), velocity = sampled.velocity[p].cast<float>();
      const double age = frame.time - sampled.birth_time[p];
      const bool was_gone = t > 0 && trajectory.frames.back().position[p][1] <= top_of_sink;
      frame.position.push_back(age < 0    ? place
                               : was_gone ? trajectory.frames.back().position[p]
                                          : graph::flight_since_birth(place, velocity, scene.gravity, age));
      frame.velocity.push_back(velocity);
      frame.active.push_back(age >= 0 && frame.position.back()[1] > top_of_sink);
    }
    trajectory.frames.push_back(std::move(frame));
  }
  return trajectory;
}

inline void write_trajectories(const std::string& file, const std::vector<Trajectory>& trajectories) {
  std::vector<std::string> parts;
  for (const Trajectory& trajectory : trajectories) {
    parts.push_back(file + "." + std::to_string(parts.size()));
    io::TrajectoryWriter writer(parts.back(), trajectory,
                                {.velocity = false, .active = !trajectory.frames.front().active.empty()});
    for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
    writer.finish();
  }
  io::merge_trajectories(parts, file);
  for (const std::string& part : parts) std::filesystem::remove(part);
}

/// box.h5, stream.h5, and train.h5 and valid.h5 with both and a scene at rest; made once.
inline const std::string& changing_data_set() {
  static const struct Data {
    Data() : folder(test_folder("changing")) {
      write_trajectories(folder + "/box.h5", {moving_box_trajectory(1), moving_box_trajectory(2)});
      write_trajectories(folder + "/stream.h5", {stream_trajectory(1), stream_trajectory(2)});
      for (const char* name : {"/train.h5", "/valid.h5"})
        write_trajectories(folder + name, {stream_trajectory(3), moving_box_trajectory(4), resting_trajectory(5)});
    }
    ~Data() { remove_path(folder); }
    std::string folder;
  } data;
  return data.folder;
}

}  // namespace graupel::train
