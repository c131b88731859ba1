// Which moving obstacle holds a grid node, and where it puts a particle. Both are judged in the obstacle's frame: the
// velocity of the material relative to the obstacle's point there.
#pragma once

#include "mpm/grid/moving_obstacles.h"
#include "mpm/grid/scene_view.h"
#include "sparsegrid/push_out.h"

namespace graupel::mpm {

/// Whether the box low .. high may hold nodes that a moving obstacle holds: those nearer to it than half a cell, where
/// phi is a little uneven.
template <typename T>
GRAUPEL_HD inline bool within_reach(const sparsegrid::ObstacleView& obstacle, const Vec<T, 3>& low,
                                    const Vec<T, 3>& high, T dx) {
  if (obstacle.is_plane) return true;
  const sparsegrid::ObstacleFrame<T>& frame = obstacle.template frame<T>();
  bool meets = true;
  for (int d = 0; d < 3; ++d)
    meets = meets && low[d] <= frame.solid_high[d] + T(2) * dx && high[d] >= frame.solid_low[d] - T(2) * dx;
  return meets;
}

/// The same of any of them.
template <typename T>
GRAUPEL_HD inline bool any_within_reach(const MovingObstacleView<T>& moving, const Vec<T, 3>& low,
                                        const Vec<T, 3>& high, T dx) {
  for (int32_t i = 0; i < moving.count; ++i)
    if (within_reach(moving.start.obstacles[moving.index[i]], low, high, dx)) return true;
  return false;
}

/// The moving obstacle that is nearest to x, or -1 where none holds the material; as EvaluateNodes does for the others.
template <int D, typename T>
GRAUPEL_HD inline int32_t holding_obstacle(const MovingObstacleView<T>& moving, const Vec<T, 3>& x, T dx,
                                           sparsegrid::SignedDistance<T>& here) {
  int32_t nearest = -1;
  for (int32_t i = 0; i < moving.count; ++i) {
    const int32_t index = moving.index[i];
    const sparsegrid::ObstacleView& obstacle = moving.start.obstacles[index];
    if (!within_reach(obstacle, x, x, dx)) continue;
    auto one = sparsegrid::signed_distance(obstacle, x);
    one.normal = normal_in_axes<D>(one.normal);
    if (!(one.phi < T(0.5) * dx) || (nearest >= 0 && one.phi >= here.phi)) continue;
    if (!(one.phi < T(0)) && !(sparsegrid::signed_distance(obstacle, x - dx * one.normal).phi > T(0))) continue;
    nearest = index;
    here = one;
  }
  return nearest;
}

/// Whether a moving obstacle holds a node at x, and material there with velocity v does not go away from it.
template <typename T>
GRAUPEL_HD inline bool node_pushes(const MovingObstacleView<T>& moving, const Vec<T, 3>& x, T dx, const Vec<T, 3>& v) {
  sparsegrid::SignedDistance<T> here{};
  const int32_t obstacle = holding_obstacle<3>(moving, x, dx, here);
  return obstacle >= 0 && dot(here.normal, moving.step[obstacle].velocity_at(x) - v) >= T(0);
}

/// Whether x lies in the box of a moving obstacle at the end of the substep.
template <typename T>
GRAUPEL_HD inline bool near_moving(const MovingObstacleView<T>& moving, const Vec<T, 3>& x) {
  for (int32_t i = 0; i < moving.count; ++i) {
    const sparsegrid::ObstacleView& obstacle = moving.end.obstacles[moving.index[i]];
    const sparsegrid::ObstacleFrame<T>& frame = obstacle.template frame<T>();
    if (sparsegrid::lookup::in_box(x, frame.solid_low, frame.solid_high)) return true;
  }
  return false;
}

/// Velocity of the surface that a particle meets which went from `before` to x in a substep. In the frame of that
/// obstacle it comes from where the obstacle would have carried it.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> velocity_of_nearest(const MovingObstacleView<T>& moving, const Vec<T, 3>& before,
                                                const Vec<T, 3>& x) {
  int nearest;
  sparsegrid::signed_distance(moving.end, x, nearest);
  return nearest >= 0 ? moving.step[nearest].velocity_at(before) : Vec<T, 3>::zero();
}

}  // namespace graupel::mpm
