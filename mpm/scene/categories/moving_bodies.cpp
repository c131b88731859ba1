#include "mpm/scene/categories/moving_bodies.h"

#include <algorithm>
#include <cmath>

namespace graupel::mpm {

namespace {

constexpr double pi = 3.14159265358979323846;

/// Thick enough that the grid sees both sides.
double wall_thickness(const SceneDraft& draft) { return 3 * draft.scene.domain.dx; }
/// Between what moves and the walls, so that material can leave.
double clearance(const SceneDraft& draft) { return 4 * draft.scene.domain.dx; }

/// Uniform in [low + margin, high - margin] along an axis; its middle where that is empty.
double between_walls(SceneDraft& draft, int axis, double margin) {
  const double low = draft.low()[axis] + margin, high = draft.high()[axis] - margin;
  return low < high ? draft.draws.uniform(low, high) : (low + high) / 2;
}

/// Size drawn for obstacles, no more than fits between two walls.
double drawn_size(SceneDraft& draft, double most) {
  return std::min(draft.draws.in(draft.recipe.obstacles.size), most);
}

double end_time(SceneDraft& draft) { return draft.draws.in(draft.recipe.motions.end) * draft.run_time(); }

Obstacle box(const Obstacle& like, const Vec3d& center, const Vec3d& size) {
  Obstacle box = like;
  box.shape = Shape::box;
  box.position = center;
  box.size = size;
  return box;
}

/// Poses of a motion to and fro: pose(time, 0) at `start`, then 1, 0, 1, .. every `leg` seconds until `end`.
template <typename Pose>
std::vector<MotionKey> to_and_fro(double start, double leg, double end, Pose&& pose) {
  std::vector<MotionKey> keys = {pose(start, 0)};
  double fraction = 1;
  for (double time = start + leg; time <= end; time += leg, fraction = fraction > 0 ? 0 : 1)
    keys.push_back(pose(time, fraction));
  if (keys.size() == 1) keys.push_back(pose(start + leg, 1));
  return keys;
}

}  // namespace

Body add_paddle(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const Vec3d inside = draft.high() - draft.low();
  const int axis = static_cast<int>(draws.integer(3)), blades = draws.chance(0.5) ? 2 : 3;
  Vec3d across = inside;  // the extents that the turn sweeps
  across[axis] = 1e300;
  const double most = std::min({across[0], across[1], across[2]}) - 2 * clearance(draft);
  const double length = drawn_size(draft, most),
               width = std::min(length * draws.uniform(0.6, 1), inside[axis] - 2 * clearance(draft));
  Obstacle blade;
  draft.set_contact(blade);
  blade.shape = Shape::box;
  blade.size = Vec3d::filled(wall_thickness(draft));
  blade.size[axis] = width;
  blade.size[axis == 0 ? 1 : 0] = length;
  for (int d = 0; d < 3; ++d)
    blade.position[d] = between_walls(draft, d, clearance(draft) + (d == axis ? width : length) / 2);
  // In the lower half, where material comes to rest.
  const double lowest = draft.low()[1] + clearance(draft) + (axis == 1 ? width : length) / 2;
  blade.position[1] = std::min(blade.position[1], lowest + 0.15 * inside[1]);
  Motion motion;
  motion.axis = Vec3d::zero();
  motion.axis[axis] = 1;
  motion.spin = draws.in(draft.recipe.motions.spin) * (draws.chance(0.5) ? 1 : -1);
  motion.start_time = draws.uniform(0, 0.3);
  motion.end_time = std::max(end_time(draft), motion.start_time + 0.1);
  motion.center = blade.position;
  blade.motion = motion;
  blade.rotation_axis = motion.axis;
  for (int i = 0; i < blades; ++i) {
    blade.rotation_angle = 180.0 * i / blades;
    draft.add(blade);
  }
  Body swept;
  swept.shape = Shape::sphere;
  swept.position = blade.position;
  swept.radius = std::hypot(length, width) / 2;
  draft.keep_out(swept);
  return swept;
}

Body add_sliding_box(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const Vec3d inside = draft.high() - draft.low();
  const int axis = draws.chance(0.5) ? 0 : 2, other = 2 - axis;
  Obstacle slider;
  draft.set_contact(slider);
  Vec3d size;
  size[axis] = std::max(wall_thickness(draft), drawn_size(draft, 0.2 * inside[axis]));
  size[other] = drawn_size(draft, inside[other] - 2 * clearance(draft));
  size[1] = std::max(wall_thickness(draft), drawn_size(draft, 0.4 * inside[1]));
  Vec3d center;
  center[other] = between_walls(draft, other, size[other] / 2 + clearance(draft));
  center[1] = draft.low()[1] + size[1] / 2;
  const double low = draft.low()[axis] + clearance(draft) + size[axis] / 2,
               high = draft.high()[axis] - clearance(draft) - size[axis] / 2;
  const double way = draws.uniform(0.4, 0.9) * (high - low), from = draws.uniform(low, high - way);
  const bool forward = draws.chance(0.5);
  center[axis] = forward ? from : from + way;
  slider = box(slider, center, size);
  Motion motion;
  motion.kind = MotionKind::keyframes;
  const double speed = draws.in(draft.recipe.motions.speed), start = draws.uniform(0.05, 0.3);
  motion.keyframes = to_and_fro(start, way / speed, end_time(draft), [&](double time, double fraction) {
    MotionKey key;
    key.time = time;
    key.translation[axis] = (forward ? way : -way) * fraction;
    return key;
  });
  slider.motion = motion;
  draft.add(slider);
  Body swept = box(slider, center, size);
  swept.size[axis] += way;
  swept.position[axis] = from + way / 2;
  draft.keep_out(swept);
  return swept;
}

Body add_tray(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const Vec3d inside = draft.high() - draft.low();
  const double t = wall_thickness(draft), tilt = draws.in(draft.recipe.motions.tilt), sine = std::sin(tilt * pi / 180);
  const int axis = draws.chance(0.5) ? 0 : 2, along = 2 - axis;  // of the turn, and of the slope
  Vec3d size;
  size[axis] = std::max(4 * t, drawn_size(draft, inside[axis] - 2 * clearance(draft)));
  size[along] = std::max(4 * t, drawn_size(draft, inside[along] - 2 * clearance(draft)));
  size[1] = t;
  const double rim = draws.uniform(1, 2) * t;
  Vec3d center;
  for (const int d : {axis, along}) center[d] = between_walls(draft, d, size[d] / 2 + clearance(draft));
  center[1] = draft.low()[1] + clearance(draft) + t + size[along] / 2 * sine;
  Obstacle part;
  draft.set_contact(part);
  Motion motion;
  motion.kind = MotionKind::keyframes;
  motion.axis = Vec3d::zero();
  motion.axis[axis] = 1;
  motion.center = center;
  const double start = draws.uniform(0.3, 0.7), leg = draws.uniform(0.4, 1.2), side = draws.chance(0.5) ? 1 : -1;
  // To one side, then from side to side.
  double angle = side * tilt;
  MotionKey rest;
  rest.time = start;
  motion.keyframes = {rest};
  for (double time = start + leg; time <= std::max(end_time(draft), start + leg); time += 2 * leg, angle = -angle) {
    MotionKey key;
    key.time = time;
    key.angle = angle;
    motion.keyframes.push_back(key);
  }
  part.motion = motion;
  draft.add(box(part, center, size));
  for (const int d : {axis, along})
    for (const int s : {-1, 1}) {
      Vec3d at = center, extent = {t, rim, t};
      at[1] += (t + rim) / 2;
      at[d] += s * (size[d] - t) / 2;
      extent[d == axis ? along : axis] = size[d == axis ? along : axis];
      draft.add(box(part, at, extent));
    }
  Body swept = box(part, center, {size[axis], 2 * (rim + t) + size[along] * sine, size[axis]});
  swept.size[along] = size[along];
  draft.keep_out(swept);
  return swept;
}

Opening add_container(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const RecipeFixedObstacles& r = draft.recipe.obstacles;
  const Vec3d inside = draft.high() - draft.low();
  Obstacle part;
  draft.set_contact(part);
  if (!r.level_set_geometry.empty() && draws.chance(0.3)) {
    const RecipeGeometry& geometry = draws.one_of(r.level_set_geometry);
    const double size =
        std::clamp(drawn_size(draft, 0.7 * std::min(inside[0], inside[2])), 0.5 * r.size.high, r.size.high);
    use_geometry(part, Shape::vdb, geometry, size);
    const sparsegrid::LocalBox file = bounds_of(geometry);
    const Vec3d extent = (file.high - file.low) * part.scale, middle = (file.high + file.low) * (part.scale / 2);
    for (const int d : {0, 2}) part.position[d] = between_walls(draft, d, extent[d] / 2) - middle[d];
    part.position[1] = draft.low()[1] - file.low[1] * part.scale;
    draft.add(part);
    const Vec3d top = part.position + middle + Vec3d{0, extent[1] / 2, 0};
    return {top, 0.6 * extent[0], 0.6 * extent[2], 0.3 * extent[0] * extent[1] * extent[2]};
  }
  const double t = wall_thickness(draft), x = std::max(6 * t, drawn_size(draft, 0.7 * inside[0])),
               z = std::max(6 * t, drawn_size(draft, 0.7 * inside[2])),
               height = std::max(3 * t, drawn_size(draft, 0.35 * inside[1]));
  Vec3d base = {between_walls(draft, 0, x / 2), draft.low()[1], between_walls(draft, 2, z / 2)};
  draft.add(box(part, base + Vec3d{0, t / 2, 0}, {x, t, z}));
  for (const int s : {-1, 1}) {
    draft.add(box(part, base + Vec3d{s * (x - t) / 2, height / 2, 0}, {t, height, z}));
    draft.add(box(part, base + Vec3d{0, height / 2, s * (z - t) / 2}, {x, height, t}));
  }
  return {base + Vec3d{0, height, 0}, x - 2 * t, z - 2 * t, (x - 2 * t) * (z - 2 * t) * (height - t)};
}

}  // namespace graupel::mpm
