// A small data set for the tests of training: clouds of particles that fly freely and bounce off a soft floor.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "core/math/random.h"
#include "core/system/atomic_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "train/config/train_config.h"

namespace graupel::train {

inline const char* tiny_scene() {
  return R"({
    "name": "bounce", "domain": {"size": [1, 1, 1], "dx": 0.03125, "wall_cells": 4},
    "materials": {"w": {"preset": "water"}, "s": {"preset": "sand"}},
    "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "w"}],
    "obstacles": [{"shape": "sphere", "radius": 0.1, "position": [0.2, 0.3, 0.2], "contact": "separate"}],
    "frames": 40, "frame_time": 0.016666666666666666
  })";
}

/// Free flight under gravity above y = 0.1875 (two cells over the wall), a stiff spring below it; velocity Verlet,
/// exact in flight.
inline Trajectory tiny_trajectory(uint64_t seed, int particles, int frames) {
  const Random random(seed, RandomPurpose::test);
  constexpr double dt = 1.0 / 60, g = 9.8, floor = 0.1875, stiffness = 1700, friction = 20;
  constexpr int substeps = 10;
  constexpr double h = dt / substeps;
  const auto force = [&](double y) { return -g + stiffness * std::max(0.0, floor - y); };
  const Vec3d velocity = {random.uniform(0, 0, -0.4, 0.4), random.uniform(0, 1, -1, 0.5),
                          random.uniform(0, 2, -0.4, 0.4)};
  std::vector<Vec3d> x, v;
  Trajectory trajectory;
  for (int i = 0; i < particles; ++i) {
    const auto draw = static_cast<uint64_t>(i) + 1;
    x.push_back(
        {random.uniform(draw, 0, 0.45, 0.6), random.uniform(draw, 1, 0.3, 0.45), random.uniform(draw, 2, 0.45, 0.6)});
    v.push_back(velocity);
    trajectory.particle_type.push_back(i % 2 ? 5 : 6);
  }
  trajectory.scene_json = io::scene_to_json(io::parse_scene(tiny_scene(), "tiny", "."));
  trajectory.seed = seed;
  for (int t = 0; t < frames; ++t) {
    ParticleFrame frame;
    frame.time = t * dt;
    for (std::size_t i = 0; i < x.size(); ++i) {
      frame.position.push_back(x[i].cast<float>());
      frame.velocity.push_back(v[i].cast<float>());
      for (int k = 0; k < substeps; ++k) {
        const double before = force(x[i][1]);
        x[i] += v[i] * h;
        x[i][1] += before * h * h / 2;
        v[i][1] += (before + force(x[i][1])) * h / 2;
        if (x[i][1] > floor) continue;
        v[i][0] *= 1 - friction * h;
        v[i][2] *= 1 - friction * h;
      }
    }
    trajectory.frames.push_back(std::move(frame));
  }
  return trajectory;
}

inline void write_split(const std::string& file, uint64_t first_seed, int trajectories, int particles, int frames) {
  std::vector<std::string> parts;
  for (int i = 0; i < trajectories; ++i) {
    const Trajectory trajectory = tiny_trajectory(first_seed + static_cast<uint64_t>(i), particles, frames);
    parts.push_back(file + "." + std::to_string(i));
    io::TrajectoryWriter writer(parts.back(), trajectory, {.velocity = false});
    for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
    writer.finish();
  }
  io::merge_trajectories(parts, file);
  for (const std::string& part : parts) std::filesystem::remove(part);
}

/// A folder of its own for a test, emptied.
inline std::string test_folder(const std::string& name) {
  const std::string folder =
      (std::filesystem::temp_directory_path() / ("graupel_train_" + std::to_string(::getpid()) + "_" + name)).string();
  remove_path(folder);
  make_folder(folder);
  return folder;
}

/// The data set of all tests, made once.
inline const std::string& tiny_data_set() {
  static const struct Data {
    Data() : folder(test_folder("data")) {
      write_split(folder + "/train.h5", 1, 4, 24, 30);
      write_split(folder + "/valid.h5", 101, 2, 24, 30);
      write_split(folder + "/test.h5", 201, 1, 24, 30);
    }
    ~Data() { remove_path(folder); }
    std::string folder;
  } data;
  return data.folder;
}

inline TrainConfig tiny_config() {
  TrainConfig config;
  config.hgn.latent = 16;
  config.hgn.levels = 2;
  config.hgn.message_passing = 1;
  config.hgn.embedding = 4;
  config.hgn.history = 2;
  config.hgn.spacing = 0.07;
  config.hgn.dx = 0.03125;
  config.hgn.signed_distance = true;
  config.batch_scenes = 4;
  config.steps = 20;
  config.learning_rate = 3e-3;
  config.noise_std = 1e-4;
  config.log_interval = 10;
  config.checkpoint_interval = 10;
  config.validation_interval = 20;
  config.validation_samples = 6;
  config.rollout_scenes = 1;
  config.rollout_frames = 5;
  return config;
}

}  // namespace graupel::train
