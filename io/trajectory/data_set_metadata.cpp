// metadata.json of a data set: what GNS and LagrangeBench read, with the statistics of the training set.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>

#include "core/parallel/device.h"
#include "core/parallel/parallel_tasks.h"
#include "core/scene/kinematic_particles.h"
#include "core/scene/periodic_walls.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/json_node.h"
#include "io/hdf5/hdf5.h"
#include "io/trajectory/motion_statistics.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::io {

namespace {

struct SetSummary {
  int64_t trajectories = 0;
  int64_t frames = 0;  ///< of the longest trajectory
  int64_t most_particles = 0;
  double frame_time = 1.0 / 60;
  std::vector<int32_t> types;
};

SetSummary summarize(const TrajectoryReader& reader) {
  SetSummary out;
  out.trajectories = reader.count();
  for (int i = 0; i < reader.count(); ++i) {
    const Trajectory header = reader.header(i);
    out.frames = std::max(out.frames, static_cast<int64_t>(header.frame_count()));
    out.most_particles = std::max(out.most_particles, static_cast<int64_t>(header.particle_count()));
    out.frame_time = header.frame_time;
    for (const int32_t type : header.particle_type)
      if (std::find(out.types.begin(), out.types.end(), type) == out.types.end()) out.types.push_back(type);
  }
  std::sort(out.types.begin(), out.types.end());
  return out;
}

/// Of the frames that are usable.
MotionStatistics motion_statistics(const TrajectoryReader& reader, int i, const Vec3d& period) {
  MotionStatistics out;
  const Trajectory header = reader.header(i);
  const auto usable = header.diverged_at_frame >= 0
                          ? std::min<int64_t>(header.diverged_at_frame, static_cast<int64_t>(header.frame_count()))
                          : static_cast<int64_t>(header.frame_count());
  std::array<std::vector<Vec3f>, 3> x;  // the last three frames, newest last
  for (int64_t frame = 0; frame < usable; ++frame) {
    std::rotate(x.begin(), x.begin() + 1, x.end());
    x[2] = std::move(reader.frames(i, frame, 1)[0].position);
    for (std::size_t p = 0; frame >= 1 && p < x[2].size(); ++p) {
      if (!moves_by_itself(header.particle_type[p])) continue;
      const Vec3d v = displacement(x[1][p], x[2][p], period);
      out.velocity.add(v);
      if (frame >= 2) out.acceleration.add(v - displacement(x[0][p], x[1][p], period));
    }
  }
  return out;
}

/// Of all trajectories. Each thread has a reader of its own; the sums are added in the order of the file.
MotionStatistics motion_statistics(const std::string& path, int count, const Vec3d& period) {
  std::vector<MotionStatistics> each(static_cast<std::size_t>(count));
  std::atomic<int> next = 0;
  const int threads = hdf5::threads_may_call() ? std::min(num_threads(), std::max(count, 1)) : 1;
  for_each_task(static_cast<std::size_t>(threads), threads, [&](std::size_t) {
    const TrajectoryReader reader(path);
    for (int i = 0; (i = next++) < count;) each[static_cast<std::size_t>(i)] = motion_statistics(reader, i, period);
  });
  MotionStatistics all;
  for (const MotionStatistics& one : each) all.add(one);
  return all;
}

JsonNode numbers(const Vec3d& v) {
  JsonNode list = JsonNode::array();
  for (int axis = 0; axis < 3; ++axis) list.items.push_back(JsonNode::of(v[axis]));
  return list;
}

JsonNode bounds_of(const Scene& scene) {
  JsonNode bounds = JsonNode::array();
  for (int axis = 0; axis < 3; ++axis) {
    JsonNode pair = JsonNode::array();
    pair.items.push_back(JsonNode::of(scene.wall_low()[axis]));
    pair.items.push_back(JsonNode::of(scene.wall_high()[axis]));
    bounds.items.push_back(std::move(pair));
  }
  return bounds;
}

/// Mean distance of neighbouring particles at the start [m].
double particle_spacing(const Scene& scene) {
  const double per_cell = scene.sources.empty() ? 8 : scene.sources.front().particles_per_cell;
  return scene.domain.dx / std::cbrt(per_cell);
}

void add_set(JsonNode& out, const std::string& folder, const std::string& name, int64_t& most_particles) {
  const std::string path = folder + "/" + name + ".h5";
  if (!std::filesystem::exists(path)) return;
  const SetSummary set = summarize(TrajectoryReader(path));
  out.set("sequence_length_" + name, JsonNode::of(set.frames - 1));
  out.set("num_trajs_" + name, JsonNode::of(set.trajectories));
  most_particles = std::max(most_particles, set.most_particles);
}

JsonNode type_names(const std::vector<int32_t>& types) {
  JsonNode names = JsonNode::object();
  for (const int32_t type : types) names.set(std::to_string(type), JsonNode::of(particle_type_name(type)));
  return names;
}

}  // namespace

void write_data_set_metadata(const std::string& folder, const Scene& any_scene, double connectivity_radius) {
  const TrajectoryReader train(folder + "/train.h5");
  const SetSummary summary = summarize(train);
  const Vec3d period = period_of(any_scene.domain);
  const auto [velocity, acceleration] = motion_statistics(folder + "/train.h5", train.count(), period);

  JsonNode out = JsonNode::object();
  out.set("case", JsonNode::of(any_scene.name));
  out.set("solver", JsonNode::of("MPM"));
  out.set("dim", JsonNode::of(int64_t(3)));
  out.set("dx", JsonNode::of(particle_spacing(any_scene)));
  out.set("dt", JsonNode::of(summary.frame_time));
  out.set("write_every", JsonNode::of(int64_t(1)));
  out.set("t_end", JsonNode::of(summary.frame_time * static_cast<double>(summary.frames - 1)));
  out.set("sequence_length", JsonNode::of(summary.frames - 1));
  int64_t most_particles = 0;
  for (const char* name : {"train", "valid", "test"}) add_set(out, folder, name, most_particles);
  out.set("num_particles_max", JsonNode::of(most_particles));
  JsonNode periodic = JsonNode::array();
  for (int axis = 0; axis < 3; ++axis) periodic.items.push_back(JsonNode::of(period[axis] > 0));
  out.set("periodic_boundary_conditions", std::move(periodic));
  out.set("bounds", bounds_of(any_scene));
  out.set("default_connectivity_radius", JsonNode::of(connectivity_radius));
  out.set("vel_mean", numbers(velocity.mean()));
  out.set("vel_std", numbers(velocity.deviation()));
  out.set("acc_mean", numbers(acceleration.mean()));
  out.set("acc_std", numbers(acceleration.deviation()));
  out.set("material_names", type_names(summary.types));
  write_file_atomically(folder + "/metadata.json", write_json(out, JsonLayout::indented));
}

}  // namespace graupel::io
