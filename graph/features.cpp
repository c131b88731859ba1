#include "graph/features.h"

#include <algorithm>
#include <atomic>
#include <string>

#include "core/error.h"
#include "core/parallel_for.h"
#include "sparsegrid/push_out.h"

namespace graupel::graph {

namespace {

Scene with_spacing(Scene scene, double dx) {
  scene.domain.dx = dx;
  return scene;
}

const Scene& checked(const Scene& scene) {
  std::string what;
  if (scene.has_moving_obstacles()) what = "moving obstacles";
  for (const Source& source : scene.sources)
    if (source.motion) what = "particles that follow a script";
  if (!scene.kinematic_regions.empty()) what = "particles that follow a script";
  if (!scene.emitters.empty()) what = "emitters";
  if (!scene.sinks.empty()) what = "sinks";
  if (scene.domain.has_wall(Wall::open)) what = "open walls";
  if (scene.domain.has_wall(Wall::periodic)) what = "periodic walls";
  if (!what.empty())
    throw ConfigError("a learned network cannot run this scene (it has " + what + ", allowed: none). Use `graupel " +
                      "simulate`, or a scene without them");
  return scene;
}

/// Distance clamped to +-limit, divided by it.
float clamped(double distance, double limit) { return static_cast<float>(std::clamp(distance, -limit, limit) / limit); }

/// Writes the features of particle i from `row` on.
class FeatureWriter {
 public:
  FeatureWriter(const HgnConfig& config, const Normalization& normalization, const Surroundings& surroundings,
                const std::vector<std::vector<Vec3f>>& positions)
      : config_(config), normalization_(normalization), surroundings_(surroundings), positions_(positions) {}

  void write(std::size_t i, float* row) const {
    const Vec3d x = positions_.back()[i].cast<double>();
    row = write_velocities(i, row);
    if (config_.cell_normal) row = put(surroundings_.normals.at(x), row);
    for (int axis = 0; axis < 3; ++axis) *row++ = clamped(x[axis] - surroundings_.wall_low[axis], config_.wall_clamp);
    for (int axis = 0; axis < 3; ++axis) *row++ = clamped(surroundings_.wall_high[axis] - x[axis], config_.wall_clamp);
    if (!config_.signed_distance) return;
    const sparsegrid::SignedDistance<double> obstacle = surroundings_.obstacles.sample(x);
    *row++ = clamped(obstacle.phi, config_.distance_clamp);
    put(obstacle.normal.cast<float>(), row);
  }

 private:
  static float* put(const Vec3f& v, float* row) {
    for (int axis = 0; axis < 3; ++axis) *row++ = v[axis];
    return row;
  }

  float* write_velocities(std::size_t i, float* row) const {
    for (std::size_t newer = positions_.size() - 1; newer > 0; --newer) {
      const Vec3f velocity = positions_[newer][i] - positions_[newer - 1][i];
      for (int axis = 0; axis < 3; ++axis)
        *row++ = (velocity[axis] - normalization_.velocity_mean[axis]) / normalization_.velocity_std[axis];
    }
    return row;
  }

  const HgnConfig& config_;
  const Normalization& normalization_;
  const Surroundings& surroundings_;
  const std::vector<std::vector<Vec3f>>& positions_;
};

}  // namespace

Surroundings::Surroundings(const Scene& scene, std::optional<double> spacing)
    : obstacles(checked(scene)),
      normals(with_spacing(scene, spacing.value_or(scene.domain.dx)), obstacles),
      normal_spacing(spacing.value_or(scene.domain.dx)),
      wall_low(scene.domain.origin),
      wall_high(scene.domain.origin + scene.domain.size),
      hold_low(scene.wall_low()),
      hold_high(scene.wall_high()) {}

std::vector<float> particle_features(const HgnConfig& config, const Normalization& normalization,
                                     const Surroundings& surroundings,
                                     const std::vector<std::vector<Vec3f>>& positions) {
  GRAUPEL_ASSERT(positions.size() == static_cast<std::size_t>(config.history) + 1);
  const std::size_t n = positions.back().size();
  for (const auto& frame : positions) GRAUPEL_ASSERT(frame.size() == n);
  const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
  std::vector<float> features(n * width);
  const FeatureWriter writer(config, normalization, surroundings, positions);
  parallel_for(Device::cpu, static_cast<int64_t>(n), [&](int64_t i) {
    writer.write(static_cast<std::size_t>(i), features.data() + static_cast<std::size_t>(i) * width);
  });
  return features;
}

int embedding_row(int32_t particle_type) {
  if (particle_type < 0 || particle_type >= embedding_rows)
    throw InputError("a particle type is not known to the network (" + std::to_string(particle_type) +
                     ", allowed 0 to 8). Use the ids of the data format: 5 water, 6 sand, 8 snow");
  return particle_type;
}

int64_t project_out(const Surroundings& surroundings, std::vector<Vec3f>& position) {
  return project_out(surroundings, std::vector<Vec3f>(position), position);
}

int64_t project_out(const Surroundings& surroundings, const std::vector<Vec3f>& before, std::vector<Vec3f>& position) {
  GRAUPEL_ASSERT(before.size() == position.size());
  const sparsegrid::ObstacleSetView obstacles = surroundings.obstacles.view();
  const Vec3f low = surroundings.hold_low.cast<float>(), high = surroundings.hold_high.cast<float>();
  std::atomic<int64_t> moved = 0;
  parallel_for(Device::cpu, static_cast<int64_t>(position.size()), [&](int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    if (sparsegrid::push_out(obstacles, low, high, before[p], position[p]))
      moved.fetch_add(1, std::memory_order_relaxed);
  });
  return moved;
}

}  // namespace graupel::graph
