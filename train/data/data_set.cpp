#include "train/data/data_set.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"
#include "mpm/scene/particle_materials.h"
#include "train/parallel/worker_threads.h"

namespace graupel::train {

namespace {

std::mutex reading;  // HDF5 is used by one thread at a time, whatever the file

double half_of_memory() {
  return 0.5 * static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGE_SIZE));
}

/// Sums over one trajectory, of velocities (0) and accelerations (1).
struct Sums {
  std::array<std::array<double, 3>, 2> first{}, second{};
  std::array<double, 2> count{};
  void add(int what, const Vec3d& value) {
    const auto w = static_cast<std::size_t>(what);
    for (std::size_t d = 0; d < 3; ++d) {
      first[w][d] += value[static_cast<int>(d)];
      second[w][d] += value[static_cast<int>(d)] * value[static_cast<int>(d)];
    }
    count[w] += 1;
  }
  void add(const Sums& other) {
    for (std::size_t w = 0; w < 2; ++w) {
      count[w] += other.count[w];
      for (std::size_t d = 0; d < 3; ++d) {
        first[w][d] += other.first[w][d];
        second[w][d] += other.second[w][d];
      }
    }
  }
};

/// Accelerations count less `predicted` [m/frame^2].
Sums sums_of(const TrajectoryInfo& info, const std::vector<std::vector<Vec3f>>& frames) {
  Sums sums;
  for (std::size_t t = 1; t < frames.size(); ++t)
    for (std::size_t p = 0; p < frames[t].size(); ++p) {
      if (info.is_kinematic(p)) continue;
      const Vec3d current = frames[t][p].cast<double>(), before = frames[t - 1][p].cast<double>();
      sums.add(0, current - before);
      if (t + 1 < frames.size()) sums.add(1, frames[t + 1][p].cast<double>() - current - (current - before));
    }
  return sums;
}

void finish(const Sums& sums, std::size_t what, const Vec3d& noise_std, float (&mean)[3], float (&deviation)[3]) {
  for (std::size_t d = 0; d < 3; ++d) {
    const double m = sums.first[what][d] / sums.count[what];
    const double noise = noise_std[static_cast<int>(d)];
    const double variance = std::max(0.0, sums.second[what][d] / sums.count[what] - m * m) + noise * noise;
    mean[d] = static_cast<float>(m);
    // An axis along which nothing moves (and no noise is added) has no scale of its own.
    deviation[d] = variance > 1e-18 ? static_cast<float>(std::sqrt(variance)) : 1.0f;
  }
}

}  // namespace

DataSplit::DataSplit(const std::string& file, const DataSplitOptions& options)
    : file_(file), reader_(std::make_unique<io::TrajectoryReader>(file)) {
  read_headers(options);
  build_contexts(options);
  if (options.materials) find_materials(options);
  load_positions(options);
}

void DataSplit::read_headers(const DataSplitOptions& options) {
  const int n = reader_->count();
  if (n == 0) throw InputError("'" + file_ + "' holds no trajectory. Make one with 'graupel generate'");
  for (int i = 0; i < n; ++i) {
    const Trajectory header = reader_->header(i);
    const std::string where = "'" + file_ + "': trajectory " + std::to_string(i);
    TrajectoryInfo info;
    info.frames = static_cast<int64_t>(header.frame_count());
    if (header.diverged_at_frame >= 0) info.frames = std::min(info.frames, header.diverged_at_frame);
    if (info.frames < 3)
      throw InputError(where + " is too short (" + std::to_string(info.frames) + " usable frames, at least 3)");
    if (header.scene_json.empty())
      throw InputError(where +
                       " has no scene, which the obstacle and wall features need. Use data of 'graupel generate'");
    for (const int32_t type : header.particle_type) info.type_row.push_back(graph::embedding_row(type));
    info.kinematic = kinematic_mask(header.particle_type);
    if (info.kinematic_count() == static_cast<int64_t>(info.type_row.size()))
      throw InputError(where + " has no particle that moves by itself (" + std::to_string(info.type_row.size()) +
                       " of obstacles or stationary). Leave that run out");
    info.converted = header.made_by.starts_with("converted from");
    info.initial_velocity = reader_->initial_velocity(i);
    if (info.initial_velocity.empty()) {
      const auto start = reader_->frames(i, 0, 2);
      for (std::size_t p = 0; p < info.type_row.size(); ++p)
        info.initial_velocity.push_back((start[1].position[p] - start[0].position[p]) *
                                        static_cast<float>(1 / header.frame_time));
    }
    scene_json_.push_back(header.scene_json);
    info_.push_back(std::move(info));
    if (options.progress) options.progress("headers", i + 1, n);
  }
}

void DataSplit::build_contexts(const DataSplitOptions& options) {
  std::map<std::string, std::vector<std::size_t>> users;
  for (std::size_t i = 0; i < info_.size(); ++i) users[scene_json_[i]].push_back(i);
  std::vector<const std::vector<std::size_t>*> groups;
  for (const auto& [json, trajectories] : users) groups.push_back(&trajectories);
  std::mutex mutex;
  int64_t done = 0;
  for_each_index(options.threads, static_cast<int64_t>(groups.size()), [&](int64_t g) {
    const auto& trajectories = *groups[static_cast<std::size_t>(g)];
    const std::string name = file_ + ", scene of trajectory " + std::to_string(trajectories.front());
    Scene scene = io::parse_stored_scene(scene_json_[trajectories.front()], name, file_);
    std::shared_ptr<const SceneContext> context;
    try {
      context = std::make_shared<const SceneContext>(std::move(scene));
    } catch (const ConfigError& error) {
      throw ConfigError("'" + name + "': " + error.what());
    }
    const std::lock_guard lock(mutex);
    for (const std::size_t i : trajectories) info_[i].context = context;
    if (options.progress) options.progress("environment", ++done, static_cast<int64_t>(groups.size()));
  });
}

void DataSplit::find_materials(const DataSplitOptions& options) {
  for_each_index(options.threads, count(), [&](int64_t i) {
    const auto t = static_cast<int>(i);
    TrajectoryInfo& info = info_[static_cast<std::size_t>(i)];
    std::unique_lock lock(reading);
    const Trajectory header = reader_->header(t);
    const std::vector<Vec3f> start = reader_->frames(t, 0, 1).front().position;
    lock.unlock();
    info.material =
        mpm::particle_materials(info.context->scene, header, start, "'" + file_ + "': trajectory " + std::to_string(i));
  });
  has_materials_ = true;
}

void DataSplit::load_positions(const DataSplitOptions& options) {
  double left = (options.memory_limit > 0 ? options.memory_limit : half_of_memory()) / options.processes;
  resident_.resize(info_.size());
  for (std::size_t i = 0; i < info_.size(); ++i) {
    const auto numbers = static_cast<std::size_t>(info_[i].frames) * info_[i].type_row.size();
    left -= static_cast<double>(numbers * sizeof(Vec3f));
    if (left < 0) break;
    const std::vector<float> positions = reader_->positions(static_cast<int>(i), 0, info_[i].frames);
    resident_[i].resize(numbers);
    std::memcpy(resident_[i].data(), positions.data(), positions.size() * sizeof(float));
    if (options.progress) options.progress("positions", static_cast<int64_t>(i) + 1, count());
  }
}

std::string DataSplit::attribute(const std::string& name) const {
  const std::lock_guard lock(reading);
  return reader_->attribute(0, name);
}

std::vector<std::vector<Vec3f>> DataSplit::positions(int i, int64_t first, int64_t count) const {
  const auto& resident = resident_[static_cast<std::size_t>(i)];
  const auto n = static_cast<int64_t>(trajectory(i).type_row.size());
  std::vector<std::vector<Vec3f>> frames;
  if (!resident.empty()) {
    for (int64_t t = first; t < first + count; ++t)
      frames.emplace_back(resident.begin() + t * n, resident.begin() + (t + 1) * n);
    return frames;
  }
  const std::lock_guard lock(reading);
  for (ParticleFrame& frame : reader_->frames(i, first, count)) frames.push_back(std::move(frame.position));
  return frames;
}

std::vector<std::vector<Vec3f>> DataSplit::history(int i, int64_t frame, int64_t history) const {
  if (frame >= history) return positions(i, frame - history, history + 1);
  const TrajectoryInfo& info = trajectory(i);
  std::vector<std::vector<Vec3f>> real = positions(i, 0, frame + 1);
  std::vector<std::vector<Vec3f>> all =
      graph::start_history(real.front(), info.initial_velocity, info.context->scene.gravity,
                           info.context->scene.frame_time, static_cast<int>(history - frame) + 1, info.kinematic);
  all.pop_back();
  std::move(real.begin(), real.end(), std::back_inserter(all));
  return all;
}

graph::Normalization DataSplit::statistics(double noise_std, int threads) const {
  std::vector<Sums> sums(info_.size());
  for_each_index(threads, count(), [&](int64_t i) {
    const TrajectoryInfo& info = trajectory(static_cast<int>(i));
    sums[static_cast<std::size_t>(i)] = sums_of(info, positions(static_cast<int>(i), 0, info.frames));
  });
  Sums total;
  for (const Sums& one : sums) total.add(one);
  graph::Normalization normalization;
  const bool plane = trajectory(0).context->scene.domain.is_plane();
  const Vec3d noise = {noise_std, noise_std, plane ? 0 : noise_std};
  finish(total, 0, noise, normalization.velocity_mean, normalization.velocity_std);
  finish(total, 1, noise, normalization.acceleration_mean, normalization.acceleration_std);
  return normalization;
}

void DataSplit::check_length(int64_t frames, const std::string& why) const {
  for (int i = 0; i < count(); ++i)
    if (trajectory(i).frames < frames)
      throw ConfigError("'" + file_ + "': trajectory " + std::to_string(i) + " is too short for training (" +
                        std::to_string(trajectory(i).frames) + " usable frames, needed " + std::to_string(frames) +
                        " for " + why + "). Lower these, or generate longer runs");
}

void DataSplit::check_fits(const NetworkConfig& network_config, const std::string& weights) const {
  const graph::FeatureConfig& config = features_of(network_config);
  const std::string section = word_of(architecture_of(network_config));
  const auto differs = [](double a, double b) { return std::abs(a - b) > 1e-6 * std::abs(b); };
  for (int i = 0; i < count(); ++i) {
    const Scene& scene = trajectory(i).context->scene;
    const auto refuse = [&](const std::string& what, const std::string& data, const std::string& network) {
      const std::string is_for =
          data + ", the network " + (weights.empty() ? "" : "'" + weights + "' ") + "is for " + network + ". ";
      throw ConfigError("'" + file_ + "': trajectory " + std::to_string(i) + " has " + what + " " + is_for +
                        (weights.empty() ? "Set " + section + "." + what + " to that of the data"
                                         : "Take data with its " + what + ", or other weights"));
    };
    if (scene.domain.dimensions != config.dimensions)
      refuse("dimensions", std::to_string(scene.domain.dimensions), std::to_string(config.dimensions));
    const auto* gns = std::get_if<graph::GnsConfig>(&network_config);
    if (scene.domain.is_plane() && gns != nullptr && gns->obstacle_particles && !scene.obstacles.empty())
      throw ConfigError("'" + file_ + "': trajectory " + std::to_string(i) +
                        " has obstacles in the plane, which are not made of particles (gns.obstacle_particles true, "
                        "allowed there: false). Set gns.obstacle_particles=false");
    if (differs(scene.frame_time, config.frame_time))
      refuse("frame_time", std::to_string(scene.frame_time), std::to_string(config.frame_time));
    if (config.cell_normal && differs(scene.domain.dx, config.dx))
      refuse("dx", std::to_string(scene.domain.dx), std::to_string(config.dx));
  }
}

}  // namespace graupel::train
