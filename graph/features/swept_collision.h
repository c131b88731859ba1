// push_out for ways that may lead through obstacles thinner than they are long, for host and device.
#pragma once

#include "core/scene/motion.h"
#include "sparsegrid/obstacle.h"
#include "sparsegrid/push_out.h"

namespace graupel::graph {

/// A way that may meet an obstacle is taken in pieces, each as long as the obstacles are far (phi grows by at most
/// steepest_grid per way).
struct SweptCollision {
  sparsegrid::ObstacleSetView obstacles;
  Vec3f low, high;  ///< [m] box that holds the particles
  float piece;      ///< [m] Environment::way_piece

  /// Moves x, reached from `before`; returns whether it changed.
  GRAUPEL_HD bool follow(const Vec3f& before, Vec3f& x) const {
    const Vec3f way = x - before;
    const float length = norm(way);
    float free = 0;
    if (length > piece && !may_meet_obstacle(before, x)) return clamp(x);
    if (!(length > piece) || obstacles.count == 0 || (free = clearance(before)) < 0 || free >= length ||
        free + clearance(x) >= length)
      return push(before, x);
    const float even = length / most_pieces, shortest = piece > even ? piece : even;
    Vec3f at = before, pushed = Vec3f::zero();
    bool moved = false;
    for (float done = 0; done < length; free = clearance(at)) {
      const float step = shortest > free ? shortest : free;
      const bool last = done + step >= length;
      const Vec3f wanted = (last ? x : before + way * ((done + step) / length)) + pushed;
      Vec3f next = wanted;
      if (push(at, next)) {
        moved = true;
        pushed += next - wanted;
      }
      at = next;
      done = last ? length : done + step;
    }
    x = at;
    return moved;
  }

  static constexpr float most_pieces = 1000;
  static constexpr int halvings = 8;  ///< a 256th of a piece is finer than a frame asks for

  GRAUPEL_HD bool push(const Vec3f& before, Vec3f& x) const {
    return sparsegrid::push_out<3, halvings>(obstacles, low, high, before, x);
  }

  GRAUPEL_HD bool may_meet_obstacle(const Vec3f& a, const Vec3f& b) const {
    Vec3f from = sparsegrid::lookup::clamp_to_box(a, low, high), to = sparsegrid::lookup::clamp_to_box(b, low, high);
    for (int d = 0; d < 3; ++d) {
      const float lower = from[d] < to[d] ? from[d] : to[d], upper = from[d] < to[d] ? to[d] : from[d];
      from[d] = lower;
      to[d] = upper;
    }
    return sparsegrid::lookup::may_meet_solid(obstacles, from, to);
  }
  /// Moves x to the walls; returns whether it changed.
  GRAUPEL_HD bool clamp(Vec3f& x) const {
    const Vec3f wanted = sparsegrid::lookup::clamp_to_box(x, low, high);
    const bool moves = wanted[0] != x[0] || wanted[1] != x[1] || wanted[2] != x[2];
    x = wanted;
    return moves;
  }

  GRAUPEL_HD float clearance(const Vec3f& x) const {
    int nearest = -1;
    return signed_distance(obstacles, x, nearest).phi / static_cast<float>(sparsegrid::steepest_grid);
  }
};

/// The way of a moving obstacle from one time to another, as a map of the points that it carries.
struct ObstacleWay {
  int32_t obstacle;  ///< index in the scene
  RigidMap map;
};

/// SweptCollision::follow among obstacles of which `count` have moved since x was at `before`: `way` has them where
/// they are now. In the frame of each of these the particle comes from where that obstacle has carried it.
GRAUPEL_HD inline bool follow_among_moving(const SweptCollision& way, const ObstacleWay* carriers, int32_t count,
                                           const Vec3f& before, Vec3f& x) {
  Vec3f from = before;
  bool moved = false;
  for (int32_t k = 0; k < count; ++k) {
    Vec3f carried = carriers[k].map(before.cast<double>()).cast<float>();
    SweptCollision alone = way;
    alone.obstacles = {way.obstacles.obstacles + carriers[k].obstacle, 1};
    if (!alone.may_meet_obstacle(carried, x) && !alone.may_meet_obstacle(before, x)) continue;
    alone.push(carried, carried);  // what touched it may be inside by the rounding of its map
    moved = alone.follow(carried, x) || moved;
    from = carried;
  }
  return way.follow(from, x) || moved;
}

}  // namespace graupel::graph
