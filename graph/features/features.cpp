#include "graph/features/features.h"

#include <algorithm>
#include <atomic>
#include <string>

#include "core/parallel/parallel_for.h"
#include "core/scene/periodic_walls.h"
#include "core/scene/scripts.h"
#include "core/system/error.h"

namespace graupel::graph {

namespace {

Scene with_spacing(Scene scene, double dx) {
  scene.domain.dx = dx;
  return scene;
}

constexpr double far_away = 1e30;  ///< [m]

/// Where a wall holds the material.
double hold(const Scene& scene, int axis, int side) {
  if (!holds_material(scene.domain.wall(axis, side))) return side == 0 ? -far_away : far_away;
  return (side == 0 ? scene.wall_low() : scene.wall_high())[axis];
}

/// Open and periodic walls are met by nothing.
SurfaceContact wall_contact(const Domain& domain, int axis, int side) {
  const Wall kind = domain.wall(axis, side);
  if (kind == Wall::stick) return {Contact::stick, 0};
  return {kind == Wall::slip ? Contact::slip : Contact::separate, static_cast<float>(domain.friction(axis, side))};
}

Vec3d holds(const Scene& scene, int side) { return {hold(scene, 0, side), hold(scene, 1, side), hold(scene, 2, side)}; }

Vec3d periods(const Scene& scene) {
  for (int d = 0; d < scene.domain.axes(); ++d) {
    const bool low = scene.domain.wall(d, 0) == Wall::periodic, high = scene.domain.wall(d, 1) == Wall::periodic;
    if (low != high)
      throw ConfigError(std::string("the periodic wall of axis ") + "xyz"[d] +
                        " has no partner at the other end (allowed: both or none). Make both periodic");
  }
  return period_of(scene.domain);
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

bool same(const RigidMap& a, const RigidMap& b) {
  const double* const first = &a.rotation.a[0][0];
  return std::equal(first, first + 9, &b.rotation.a[0][0]) && a.translation == b.translation;
}

}  // namespace

Environment::Environment(const Scene& scene, std::optional<double> spacing)
    : obstacles(scene),
      normals(with_spacing(scene, spacing.value_or(scene.domain.dx)), obstacles),
      obstacle_particles(scene, obstacles),
      normal_spacing(spacing.value_or(scene.domain.dx)),
      plane(scene.domain.is_plane() ? std::optional(scene.domain.plane()) : std::nullopt),
      wall_low(scene.domain.origin),
      wall_high(scene.domain.origin + scene.domain.size),
      hold_low(holds(scene, 0)),
      hold_high(holds(scene, 1)),
      box_low(scene.wall_low()),
      box_high(scene.wall_high()),
      period(periods(scene)),
      gravity_step((scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>()),
      frame_time(scene.frame_time),
      materials(scene),
      way_piece(longest_piece(obstacles, scene.voxel())) {
  for (int face = 0; face < 2 * scene.domain.axes(); ++face)
    wall[face % 2 * 3 + face / 2] = wall_contact(scene.domain, face / 2, face % 2);
  if (!scene.has_moving_obstacles()) return;
  Scene parts;
  parts.domain = scene.domain;
  parts.domain.dx = normal_spacing;
  parts.obstacles = scene.obstacles;
  moving = std::make_shared<const Scene>(std::move(parts));
  set_time(0);
}

namespace {

/// Where each obstacle was a frame before `time` [s], from where it is.
std::vector<RigidMap> carried_from_of(const std::vector<Obstacle>& obstacles, double time, double frame_time) {
  std::vector<RigidMap> carried_from;
  for (const Obstacle& obstacle : obstacles) {
    RigidMap& map = carried_from.emplace_back();
    if (!obstacle.motion) continue;
    const RigidMap before = obstacle.motion->at(std::max(0.0, time - frame_time), obstacle.position),
                   now = obstacle.motion->at(time, obstacle.position);
    map.rotation = before.rotation * transpose(now.rotation);
    map.translation = before.translation - map.rotation * now.translation;
  }
  return carried_from;
}

}  // namespace

void Environment::set_time(double when) {
  time = when;
  if (moves()) carried_from = carried_from_of(moving->obstacles, time, frame_time);
}

Environment Environment::at(double when) const {
  Environment placed = *this;
  placed.set_time(when);
  if (!moves()) return placed;
  placed.obstacles = obstacles.at(when);
  placed.normals = normals.at(when);
  placed.obstacle_particles = ObstacleParticles(*moving, placed.obstacles);
  return placed;
}

EnvironmentPose Environment::pose_at(double when, Device device) const {
  GRAUPEL_ASSERT(moves());
  return {obstacles.views_at(when, device), carried_from_of(moving->obstacles, when, frame_time),
          normals.carried_at(when, device)};
}

std::vector<ObstacleWay> Environment::ways_between(double from, double to) const {
  std::vector<ObstacleWay> ways;
  if (!moves()) return ways;
  for (std::size_t i = 0; i < moving->obstacles.size(); ++i) {
    const Obstacle& obstacle = moving->obstacles[i];
    if (!obstacle.motion) continue;
    const RigidMap before = obstacle.motion->at(from, obstacle.position),
                   now = obstacle.motion->at(to, obstacle.position);
    if (same(before, now)) continue;
    const Mat3d rotation = now.rotation * transpose(before.rotation);
    ways.push_back({static_cast<int32_t>(i), {rotation, now.translation - rotation * before.translation}});
  }
  return ways;
}

Vec3f Environment::point_before(const Vec3f& point, double seconds) const {
  int nearest = -1;
  if (moves()) obstacles.sample(point.cast<double>(), &nearest);
  if (nearest < 0) return point;
  const Obstacle& obstacle = moving->obstacles[static_cast<std::size_t>(nearest)];
  if (!obstacle.motion) return point;
  const RigidMap before = obstacle.motion->at(std::max(0.0, time - seconds), obstacle.position),
                 now = obstacle.motion->at(time, obstacle.position);
  return before(transpose(now.rotation) * (point.cast<double>() - now.translation)).cast<float>();
}

const Environment& MovingEnvironment::at(double time) {
  if (!start_.moves()) return start_;
  Environment now = placed_ ? *placed_ : start_;
  const double before = now.time;
  now.set_time(time);
  placed_ = now.ways_between(before, time).empty() ? std::move(now) : start_.at(time);
  return *placed_;
}

SweptCollision Environment::swept_collision(Device device) const {
  return {obstacles.view(device), hold_low.cast<float>(), hold_high.cast<float>(), static_cast<float>(way_piece)};
}

EnvironmentView Environment::view(Device device) const {
  GRAUPEL_ASSERT(device == Device::cpu || !moves());
  const sparsegrid::ObstacleNormalsView all_normals = normals.view();
  return view_of_pose(device,
                      {obstacles.view(device).obstacles, moves() ? carried_from.data() : nullptr, all_normals.carried});
}

EnvironmentView Environment::view_of_pose(Device device, const PoseView& pose) const {
  EnvironmentView all;
  all.obstacles = obstacles.view(device);
  all.obstacles.obstacles = pose.obstacles;
  all.normals = normals.view(device, pose.normals);
  all.carried_from = pose.carried_from;
  all.wall_low = wall_low;
  all.wall_high = wall_high;
  all.plane = plane.has_value();
  all.hold_low = hold_low;
  all.hold_high = hold_high;
  std::copy(std::begin(wall), std::end(wall), all.wall);
  all.materials = materials.constants(device);
  for (int d = 0; d < 3; ++d) {
    const bool none = plane.has_value() && d == 2;
    if (none || hold_low[d] == -far_away) all.wall_low[d] = all.hold_low[d] = -far_away;
    if (none || hold_high[d] == far_away) all.wall_high[d] = all.hold_high[d] = far_away;
  }
  return all;
}

Vec3d Environment::grid_origin(double spacing) const {
  return {wall_low[0], wall_low[1], plane ? *plane - spacing : wall_low[2]};
}

std::vector<float> particle_features(const FeatureConfig& config, const Normalization& normalization,
                                     const Environment& environment, const std::vector<std::vector<Vec3f>>& positions,
                                     const std::vector<int32_t>& material, const AxisMap& symmetry) {
  GRAUPEL_ASSERT(positions.size() == static_cast<std::size_t>(config.history) + 1);
  const std::size_t n = positions.back().size();
  for (const auto& frame : positions) GRAUPEL_ASSERT(frame.size() == n);
  GRAUPEL_ASSERT(!config.material_constants || material.size() == n);
  const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
  std::vector<float> features(n * width);
  const FeatureRules rules(config, normalization);
  const EnvironmentView view = environment.view(Device::cpu);
  parallel_for(Device::cpu, static_cast<int64_t>(n), [&](int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    Vec3f history[most_history + 1];
    for (std::size_t t = 0; t < positions.size(); ++t) history[t] = positions[t][p];
    write_feature_row(rules, view, symmetry, config.material_constants ? material[p] : no_material, history,
                      features.data() + p * width);
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

int64_t project_out(const Environment& environment, const std::vector<Vec3f>& before, std::vector<Vec3f>& position,
                    std::optional<double> since) {
  GRAUPEL_ASSERT(before.size() == position.size());
  const SweptCollision way = environment.swept_collision(Device::cpu);
  const std::vector<ObstacleWay> carriers =
      since ? environment.ways_between(*since, environment.time) : std::vector<ObstacleWay>();
  std::atomic<int64_t> moved = 0;
  parallel_for(Device::cpu, static_cast<int64_t>(position.size()), [&](int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    const bool moves =
        carriers.empty()
            ? way.follow(before[p], position[p])
            : follow_among_moving(way, carriers.data(), static_cast<int32_t>(carriers.size()), before[p], position[p]);
    if (moves) moved.fetch_add(1, std::memory_order_relaxed);
  });
  return moved;
}

const Scene& check_training_scene(const Scene& scene) {
  std::string what;
  if (scene.domain.is_plane() && (scene.has_moving_obstacles() || scene.has_inactive_particles()))
    what = "moving obstacles, emitters, sinks or open walls in a plane";
  if (has_scripts(scene)) what = "particles that follow a script";
  if (scene.domain.has_wall(Wall::periodic)) what = "periodic walls";
  if (!scene.loads.empty()) what = "loads";
  if (scene.has_changing_gravity()) what = "gravity that changes";
  if (!what.empty())
    throw ConfigError("networks are not trained on this scene (it has " + what +
                      ", allowed: none). Leave it out, of a recipe by its categories (generate --set "
                      "'categories=[...]'); rollouts run such scenes");
  return scene;
}

}  // namespace graupel::graph
