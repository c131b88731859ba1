#include "train/data/data_set.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>

#include "core/scene/checks/frame_time_check.h"
#include "core/scene/kinematic_particles.h"
#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
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
      const auto frame = static_cast<int64_t>(t);
      if (!info.counts(p, frame - 1, frame)) continue;
      const Vec3d current = frames[t][p].cast<double>(), before = frames[t - 1][p].cast<double>();
      sums.add(0, current - before);
      if (t + 1 < frames.size() && info.is_in_run(p, frame, frame + 1))
        sums.add(1, frames[t + 1][p].cast<double>() - current - (current - before));
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

/// Frames in which each particle is in the run, from flags [frames, n]; empty where all always are. Throws InputError
/// naming `where` for one that comes back.
std::vector<FramesInRun> frames_in_run(const std::vector<uint8_t>& active, int64_t frames, std::size_t particles,
                                       const std::string& where) {
  std::vector<FramesInRun> spans(active.empty() ? 0 : particles);
  for (int64_t t = 0; t < frames; ++t)
    for (std::size_t p = 0; p < spans.size(); ++p) {
      FramesInRun& span = spans[p];
      if (active[static_cast<std::size_t>(t) * particles + p] == 0) continue;
      if (span.end > 0 && span.end < t)
        throw InputError(where + " has particle " + std::to_string(p) + " in the run again in frame " +
                         std::to_string(t) + ", after it was gone ('active', allowed: one piece of the frames). " +
                         "Generate the data set anew");
      if (span.end == 0) span.first = static_cast<int32_t>(t);
      span.end = static_cast<int32_t>(t + 1);
    }
  const bool all_stay =
      std::all_of(spans.begin(), spans.end(), [&](const FramesInRun& span) { return span.holds(0, frames - 1); });
  return all_stay ? std::vector<FramesInRun>() : spans;
}

/// Births of a scene's emitted particles. Throws InputError naming `where` for a trajectory of other ones.
graph::ParticleSchedule births_of(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& start,
                                  const std::string& where) {
  constexpr double tolerance = 1e-4;  // [m], far below the distance of particles
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, seed);
  bool fits = sampled.position.size() == start.size();
  graph::ParticleSchedule schedule;
  schedule.birth_time = sampled.birth_time;
  for (std::size_t p = 0; fits && p < start.size(); ++p) {
    schedule.birth_velocity.push_back(sampled.velocity[p].cast<float>());
    const bool is_born_later = sampled.birth_time[p] > 0;
    fits = !is_born_later || norm(sampled.position[p] - start[p].cast<double>()) <= tolerance;
  }
  if (!fits)
    throw InputError(where + ": the emitters of its scene are of other particles than the trajectory's (" +
                     std::to_string(sampled.position.size()) + " with its seed, " + std::to_string(start.size()) +
                     " stored, which may differ by 1e-4 m at their births). Generate the data set anew");
  return schedule;
}

}  // namespace

bool TrajectoryInfo::some_count(int64_t from, int64_t to) const {
  for (std::size_t p = 0; p < type_row.size(); ++p)
    if (counts(p, from, to)) return true;
  return false;
}

std::vector<int32_t> TrajectoryInfo::present(int64_t frame) const {
  std::vector<int32_t> particles;
  particles.reserve(type_row.size());
  for (std::size_t p = 0; p < type_row.size(); ++p)
    if (is_in_run(p, frame, frame)) particles.push_back(static_cast<int32_t>(p));
  return particles;
}

ParticleKinds TrajectoryInfo::kinds(const std::vector<int32_t>& particles) const {
  return {particle_rows(type_row, particles), particle_rows(material, particles)};
}

DataSplit::DataSplit(const std::string& file, const DataSplitOptions& options)
    : file_(file), reader_(std::make_unique<io::TrajectoryReader>(file)) {
  read_headers(options);
  build_contexts(options);
  if (options.check) options.check(*this);
  if (options.materials) find_materials(options);
  find_births(options);
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
    info.frame_time = header.frame_time;
    if (header.diverged_at_frame >= 0) info.frames = std::min(info.frames, header.diverged_at_frame);
    if (info.frames < 3)
      throw InputError(where + " is too short (" + std::to_string(info.frames) + " usable frames, at least 3)");
    if (header.scene_json.empty())
      throw InputError(where +
                       " has no scene, which the obstacle and wall features need. Use data of 'graupel generate'");
    try {
      for (const int32_t type : header.particle_type) info.type_row.push_back(graph::embedding_row(type));
    } catch (const InputError& error) {
      throw InputError(where + ": " + error.what());
    }
    info.kinematic = kinematic_mask(header.particle_type);
    if (info.kinematic_count() == static_cast<int64_t>(info.type_row.size()))
      throw InputError(where + " has no particle that moves by itself (" + std::to_string(info.type_row.size()) +
                       " of obstacles or stationary). Leave that run out");
    info.converted = header.made_by.starts_with("converted from");
    const std::vector<uint8_t> active = reader_->active(i);
    info.tells_presence = !active.empty();
    info.in_run = frames_in_run(active, info.frames, info.type_row.size(), where);
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
  groups.reserve(users.size());
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
    for (const std::size_t i : trajectories)
      check_frame_time(info_[i].frame_time, context->scene.frame_time,
                       "'" + file_ + "': trajectory " + std::to_string(i));
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
        mpm::network_materials(info.context->scene, header, start, "'" + file_ + "': trajectory " + std::to_string(i));
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

void DataSplit::find_births(const DataSplitOptions& options) {
  for_each_index(options.threads, count(), [&](int64_t i) {
    TrajectoryInfo& info = info_[static_cast<std::size_t>(i)];
    const Scene& scene = info.context->scene;
    if (!scene.has_inactive_particles()) return;
    const auto t = static_cast<int>(i);
    const std::string where = "'" + file_ + "': trajectory " + std::to_string(i);
    if (!info.tells_presence)
      throw InputError(where +
                       " does not tell which particles are in the run (no 'active', although its scene has "
                       "emitters, sinks or open walls). Generate the data set anew");
    if (scene.emitters.empty()) return;
    std::unique_lock lock(reading);
    const uint64_t seed = reader_->header(t).seed;
    const std::vector<Vec3f> start = reader_->frames(t, 0, 1).front().position;
    lock.unlock();
    info.schedule = births_of(scene, seed, start, where);
  });
}

std::string DataSplit::attribute(const std::string& name) const {
  const std::lock_guard lock(reading);
  return reader_->attribute(0, name);
}

std::string DataSplit::hash() const {
  std::string all;
  for (int i = 0; i < count(); ++i) {
    const TrajectoryInfo& info = trajectory(i);
    all += fmt::format("{} {} {}\n", info.frames, info.type_row.size(), scene_json(i));
  }
  const std::vector<Vec3f> first = positions(0, 0, 1).front();
  const uint64_t before = fnv1a(fnv_start, all.data(), all.size());
  return fmt::format("{:016x}", fnv1a(before, first.data(), first.size() * sizeof(Vec3f)));
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
  const TrajectoryInfo& info = trajectory(i);
  const Scene& scene = info.context->scene;
  std::vector<std::vector<Vec3f>> all =
      positions(i, std::max<int64_t>(0, frame - history), std::min(frame, history) + 1);
  if (frame < history) {
    std::vector<std::vector<Vec3f>> past =
        graph::start_history(all.front(), info.initial_velocity, scene.gravity, scene.frame_time,
                             static_cast<int>(history - frame) + 1, info.kinematic);
    past.pop_back();
    for (std::size_t p = 0; p < info.schedule.birth_time.size(); ++p)
      if (info.schedule.birth_time[p] > 0)  // waits at the place of its birth
        for (std::vector<Vec3f>& before : past) before[p] = all.front()[p];
    all.insert(all.begin(), std::make_move_iterator(past.begin()), std::make_move_iterator(past.end()));
  }
  graph::add_past_of_born(scene, info.schedule, info.context->time_of(frame), all);
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
  if (total.count[0] == 0 || total.count[1] == 0)
    throw InputError("'" + file_ + "' has no particle that moves by itself and is in the run for three frames. " +
                     "Generate longer runs, or runs of moving material");
  graph::Normalization normalization;
  const bool plane = trajectory(0).context->scene.domain.is_plane();
  const Vec3d noise = {noise_std, noise_std, plane ? 0 : noise_std};
  finish(total, 0, noise, normalization.velocity_mean, normalization.velocity_std);
  finish(total, 1, noise, normalization.acceleration_mean, normalization.acceleration_std);
  return normalization;
}

void DataSplit::check_samples(int64_t bundle, int64_t push_steps) const {
  const int64_t needed = bundle * (1 + push_steps);  // after the sample's own frame
  for (int i = 0; i < count(); ++i) {
    const TrajectoryInfo& info = trajectory(i);
    const std::string where = "'" + file_ + "': trajectory " + std::to_string(i);
    if (info.frames <= needed)
      throw ConfigError(where + " is too short for training (" + std::to_string(info.frames) +
                        " usable frames, needed " + std::to_string(needed + 1) + " for bundle " +
                        std::to_string(bundle) + " and push_steps " + std::to_string(push_steps) +
                        "). Lower these, or generate longer runs");
    int64_t first = 0;
    while (first < info.frames - needed && !info.some_count(first, first + bundle)) ++first;
    if (first == info.frames - needed)
      throw InputError(where + " has no particle that moves by itself and is in the run for " +
                       std::to_string(bundle + 1) + " frames (of 0 to " + std::to_string(first - 1 + bundle) +
                       "). Leave it out, or generate longer runs");
  }
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
    if (scene.has_moving_obstacles() && gns != nullptr && gns->obstacle_particles)
      throw ConfigError("'" + file_ + "': trajectory " + std::to_string(i) +
                        " has moving obstacles, whose particles networks are not trained on (gns.obstacle_particles "
                        "true, allowed there: false). Set gns.obstacle_particles=false, or leave that run out");
    if (differs(scene.frame_time, config.frame_time))
      refuse("frame_time", std::to_string(scene.frame_time), std::to_string(config.frame_time));
    if (config.cell_normal && differs(scene.domain.dx, config.dx))
      refuse("dx", std::to_string(scene.domain.dx), std::to_string(config.dx));
  }
}

}  // namespace graupel::train
