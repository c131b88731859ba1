#include "graph/features/features.h"

#include <algorithm>
#include <atomic>
#include <string>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"

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

/// Longest piece of a particle's way [m] that cannot jump over an obstacle: a grid's smallest value is half of the
/// obstacle's greatest thickness, which is what a plate has everywhere; the grid tells nothing finer than a voxel.
double longest_piece(const sparsegrid::ObstacleSet& obstacles, double voxel) {
  double piece = voxel;
  const sparsegrid::ObstacleSetView view = obstacles.view();
  for (int i = 0; i < view.count; ++i)
    if (!view.obstacles[i].is_plane) piece = std::min(piece, -obstacles.facts(i).min_value);
  return std::max(piece, voxel / 64);
}

}  // namespace

Environment::Environment(const Scene& scene, std::optional<double> spacing)
    : obstacles(checked(scene)),
      normals(with_spacing(scene, spacing.value_or(scene.domain.dx)), obstacles),
      obstacle_particles(scene, obstacles),
      normal_spacing(spacing.value_or(scene.domain.dx)),
      plane(scene.domain.is_plane() ? std::optional(scene.domain.plane()) : std::nullopt),
      wall_low(scene.domain.origin),
      wall_high(scene.domain.origin + scene.domain.size),
      hold_low(scene.wall_low()),
      hold_high(scene.wall_high()),
      gravity_step((scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>()),
      way_piece(longest_piece(obstacles, scene.voxel())) {}

SweptCollision Environment::swept_collision(Device device) const {
  return {obstacles.view(device), hold_low.cast<float>(), hold_high.cast<float>(), static_cast<float>(way_piece)};
}

EnvironmentView Environment::view(Device device) const {
  EnvironmentView all = {obstacles.view(device), normals.view(device), wall_low, wall_high, plane.has_value()};
  constexpr double far_away = 1e30;
  if (plane) {
    all.wall_low[2] = -far_away;
    all.wall_high[2] = far_away;
  }
  return all;
}

Vec3d Environment::grid_origin(double spacing) const {
  return {wall_low[0], wall_low[1], plane ? *plane - spacing : wall_low[2]};
}

std::vector<float> particle_features(const FeatureConfig& config, const Normalization& normalization,
                                     const Environment& environment, const std::vector<std::vector<Vec3f>>& positions,
                                     const AxisMap& symmetry) {
  GRAUPEL_ASSERT(positions.size() == static_cast<std::size_t>(config.history) + 1);
  const std::size_t n = positions.back().size();
  for (const auto& frame : positions) GRAUPEL_ASSERT(frame.size() == n);
  const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
  std::vector<float> features(n * width);
  const FeatureRules rules(config, normalization);
  const EnvironmentView view = environment.view(Device::cpu);
  parallel_for(Device::cpu, static_cast<int64_t>(n), [&](int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    Vec3f history[most_history + 1];
    for (std::size_t t = 0; t < positions.size(); ++t) history[t] = positions[t][p];
    write_feature_row(rules, view, symmetry, history, features.data() + p * width);
  });
  return features;
}

int embedding_row(int32_t particle_type) {
  if (particle_type == particle_type_of(MaterialModel::stationary)) return stationary_row;
  if (particle_type < 0 || particle_type >= embedding_rows)
    throw InputError("a particle type is not known to the network (" + std::to_string(particle_type) +
                     ", allowed 0 to 8, 13). Use the ids of the data format: 5 water, 6 sand, 8 snow");
  return particle_type;
}

void keep_in_plane(const Environment& environment, std::vector<Vec3f>& position) {
  if (!environment.plane) return;
  const auto z = static_cast<float>(*environment.plane);
  for (Vec3f& x : position) x[2] = z;
}

int64_t project_out(const Environment& environment, const std::vector<Vec3f>& before, std::vector<Vec3f>& position) {
  GRAUPEL_ASSERT(before.size() == position.size());
  const SweptCollision way = environment.swept_collision(Device::cpu);
  std::atomic<int64_t> moved = 0;
  parallel_for(Device::cpu, static_cast<int64_t>(position.size()), [&](int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    if (way.follow(before[p], position[p])) moved.fetch_add(1, std::memory_order_relaxed);
  });
  return moved;
}

}  // namespace graupel::graph
