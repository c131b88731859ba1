// Keeps a point out of obstacles and inside a box, for host and device: projection along the normal of the deepest
// obstacle, and, where that does not end outside, the last free point of the way that was travelled.
#pragma once

#include <limits>

#include "sparsegrid/obstacle.h"

namespace graupel::sparsegrid {

namespace lookup {

/// False when the box of the solid, or one value of the grid, tells that phi is positive at x: spares eight reads.
template <typename T>
GRAUPEL_HD bool may_be_inside(const ObstacleView& obstacle, const Vec<T, 3>& x) {
  const ObstacleFrame<T>& frame = obstacle.template frame<T>();
  if (!in_box(x, frame.solid_low, frame.solid_high)) return false;
  if (obstacle.is_plane) return true;
  const Vec<int, 3> base = floor_of(to_local(frame, x) * frame.inverse_voxel);
  return static_cast<T>(value_at(obstacle, base)) * frame.inverse_voxel <= T(3 * steepest_grid);
}

/// In a plane run: the way out of an obstacle's section along the plane, per phi. A shallow section may be left by a
/// far way, which is cut.
template <int D, typename T>
GRAUPEL_HD Vec<T, 3> way_out(Vec<T, 3> normal) {
  if constexpr (D == 2) {
    normal[2] = T(0);
    const T slope = norm(normal), least = T(0.25);
    normal *= slope > T(1e-3) ? T(1) / (slope * (slope > least ? slope : least)) : T(0);
  }
  return normal;
}

/// False when no point of the box low .. high [m] can be inside an obstacle.
template <typename T>
GRAUPEL_HD bool may_meet_solid(const ObstacleSetView& set, const Vec<T, 3>& low, const Vec<T, 3>& high) {
  bool meets = false;
  set.for_each_near(low, high, [&](int32_t i) {
    const ObstacleFrame<T>& frame = set.obstacles[i].template frame<T>();
    bool apart = false;
    for (int d = 0; d < 3; ++d) apart = apart || low[d] > frame.solid_high[d] || high[d] < frame.solid_low[d];
    meets = meets || !apart;
  });
  return meets;
}

/// The obstacle that a point is deepest in; phi is no_obstacle_distance where none can be entered.
template <typename T>
GRAUPEL_LOOKUP GRAUPEL_HD SignedDistance<T> deepest(const ObstacleSetView& set, const Vec<T, 3>& x) {
  SignedDistance<T> found = {static_cast<T>(no_obstacle_distance), Vec<T, 3>::zero()};
  set.near(x).for_each([&](int32_t i) {
    if (!may_be_inside(set.obstacles[i], x)) return;
    const SignedDistance<T> one = signed_distance(set.obstacles[i], x);
    if (one.phi < found.phi) found = one;
  });
  return found;
}

/// Its phi alone.
template <typename T>
GRAUPEL_LOOKUP GRAUPEL_HD T deepest_phi(const ObstacleSetView& set, const Vec<T, 3>& x) {
  T found = static_cast<T>(no_obstacle_distance);
  set.near(x).for_each([&](int32_t i) {
    if (!may_be_inside(set.obstacles[i], x)) return;
    const T phi = signed_distance(set.obstacles[i], x).phi;
    if (phi < found) found = phi;
  });
  return found;
}

template <typename T>
GRAUPEL_HD Vec<T, 3> clamp_to_box(Vec<T, 3> x, const Vec<T, 3>& low, const Vec<T, 3>& high) {
  for (int d = 0; d < 3; ++d) {
    if (x[d] < low[d]) x[d] = low[d];
    if (x[d] > high[d]) x[d] = high[d];
  }
  return x;
}

/// Bound of the rounding error of phi at x [m]: a point counts as free only beyond it, so that a look-up in higher
/// precision finds it free as well.
template <typename T>
GRAUPEL_HD T rounding_skin(const Vec<T, 3>& x) {
  T largest = T(0.1);
  for (int d = 0; d < 3; ++d) largest = std::abs(x[d]) > largest ? std::abs(x[d]) : largest;
  return T(8) * std::numeric_limits<T>::epsilon() * largest;
}

/// Whether the straight way from a to b passes through an obstacle.
template <typename T>
GRAUPEL_HD bool way_is_blocked(const ObstacleSetView& set, const Vec<T, 3>& a, const Vec<T, 3>& b, T skin) {
  constexpr int probes = 8;
  for (int i = 1; i < probes; ++i)
    if (deepest_phi(set, a + (b - a) * (T(i) / T(probes))) < -skin) return true;
  return false;
}

/// The last free point of the way from the free point `from` to `to`, by bisection, to 2^-halvings of the way.
template <int halvings, typename T>
GRAUPEL_HD Vec<T, 3> last_free_point(const ObstacleSetView& set, const Vec<T, 3>& from, const Vec<T, 3>& to, T skin) {
  Vec<T, 3> best = from;
  T free = 0, blocked = 1;
  for (int i = 0; i < halvings; ++i) {
    const T middle = (free + blocked) / 2;
    const Vec<T, 3> x = from + (to - from) * middle;
    if (deepest_phi(set, x) >= skin) {
      free = middle;
      best = x;
    } else {
      blocked = middle;
    }
  }
  return best;
}

}  // namespace lookup

/// Moves x [m] into the box low..high and out of every obstacle; returns whether x changed. When `x_before` is free
/// (in the box, phi >= 0), so is the result. A point that ends in a plate is put back on the side it came from; one
/// that ends free stays, whatever lies on its way: longer ways than obstacles are thick must be taken in pieces. With
/// D = 2 it is moved along x and y only. `halvings`: of the way to the last free point.
template <int D = 3, int halvings = 16, typename T>
GRAUPEL_HD bool push_out(const ObstacleSetView& set, const Vec<T, 3>& low, const Vec<T, 3>& high,
                         const Vec<T, 3>& x_before, Vec<T, 3>& x) {
  const Vec<T, 3> wanted = lookup::clamp_to_box(x, low, high);
  const T skin = lookup::rounding_skin(wanted);
  SignedDistance<T> hit = lookup::deepest(set, wanted);
  if (!(hit.phi < skin)) {
    const bool clamped = x[0] != wanted[0] || x[1] != wanted[1] || x[2] != wanted[2];
    x = wanted;
    return clamped;
  }
  const bool from_behind = dot(hit.normal, x_before - wanted) < T(0);
  Vec<T, 3> y = wanted;
  constexpr int projections = 8;
  for (int i = 0; i < projections && hit.phi < skin; ++i) {
    const Vec<T, 3> direction = lookup::way_out<D>(hit.normal);
    if (norm2(direction) == T(0)) break;
    // Near edges the interpolant is flatter than a distance: later steps reach farther.
    y += direction * ((T(2) * skin - hit.phi) * (T(1) + T(i) / T(4)));
    y = lookup::clamp_to_box(y, low, high);
    hit = lookup::deepest(set, y);
  }
  const bool projected = !(hit.phi < skin);
  if (!projected || from_behind) {
    const Vec<T, 3> start = lookup::clamp_to_box(x_before, low, high);
    const bool start_is_free = lookup::deepest_phi(set, start) >= T(0);
    if (start_is_free && (!projected || lookup::way_is_blocked(set, start, y, skin)))
      y = lookup::last_free_point<halvings>(set, start, wanted, skin);
  }
  x = y;
  return true;
}

}  // namespace graupel::sparsegrid
