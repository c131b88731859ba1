// push_out for ways that may lead through obstacles thinner than they are long, for host and device.
#pragma once

#include "sparsegrid/obstacle.h"
#include "sparsegrid/push_out.h"

namespace graupel::graph {

/// A way is taken in pieces, each as long as the obstacles are far (phi grows by at most steepest_grid per way), so
/// that free flight takes one.
struct WayFollower {
  sparsegrid::ObstacleSetView obstacles;
  Vec3f low, high;  ///< [m] box that holds the particles
  float piece;      ///< [m] Surroundings::way_piece

  /// Moves x, reached from `before`; returns whether it changed.
  GRAUPEL_HD bool follow(const Vec3f& before, Vec3f& x) const {
    const Vec3f way = x - before;
    const float length = norm(way);
    float free = 0;
    if (!(length > piece) || obstacles.count == 0 || (free = clearance(before)) < 0 || free >= length ||
        free + clearance(x) >= length)
      return push_out(obstacles, low, high, before, x);
    const float even = length / most_pieces, shortest = piece > even ? piece : even;
    Vec3f at = before, pushed = Vec3f::zero();
    bool moved = false;
    for (float done = 0; done < length; free = clearance(at)) {
      const float step = shortest > free ? shortest : free;
      const bool last = done + step >= length;
      const Vec3f wanted = (last ? x : before + way * ((done + step) / length)) + pushed;
      Vec3f next = wanted;
      if (push_out(obstacles, low, high, at, next)) {
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

  GRAUPEL_HD float clearance(const Vec3f& x) const {
    int nearest = -1;
    return signed_distance(obstacles, x, nearest).phi / static_cast<float>(sparsegrid::steepest_grid);
  }
};

}  // namespace graupel::graph
