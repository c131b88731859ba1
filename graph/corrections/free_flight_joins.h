// The joins of free flight by warps of a GPU. `Warp`: lane() of 32, ballot(bool), the lanes where it is true, and
// shuffle(value, lane), the value of that lane, both called by all lanes; threads may stand for lanes.
#pragma once

#include "graph/corrections/free_flight_kernels.h"
#include "graph/topology/grid_kernels.h"

namespace graupel::graph::flight {

inline constexpr int lanes_of_node = 16;

/// Joins the node `item / 16` of a time's list with its lower neighbours, a lane each; item < 0: nothing. All lanes of
/// a warp must call it. The node is hung on its lowest neighbour first.
template <typename Warp>
GRAUPEL_HD void join_neighbors(const Warp& warp, const Groups& groups, int time, int64_t item) {
  const int first_lane = warp.lane() / lanes_of_node * lanes_of_node, direction = warp.lane() % lanes_of_node;
  const Vec3i step = step_of(direction);
  int32_t node = -1;
  uint64_t matter = 0;
  Neighbor other = {-1, 0};
  if (item >= 0 && direction < directions) {
    node = groups.list[time * groups.n + item / lanes_of_node];
    matter = groups.matter[node];
    other = neighbor_of(groups, time, node, step);
  }
  bool is_near = any_near(matter, other.matter, step);
  const unsigned near_lanes = warp.ballot(is_near) >> first_lane & ((1u << directions) - 1);
  if (is_near && (near_lanes & ((1u << direction) - 1)) == 0)
    is_near = exchange_if(groups.parent[node], node, other.node) != node;
  uint64_t faces[3];
  for (int d = 0; d < 3; ++d) faces[d] = warp.shuffle(other.matter, first_lane + face_direction(d));
  if (is_near && !is_spare(step, matter, faces, other.matter)) groups.unite(node, other.node);
}

/// Joins the nodes of particle i at both times, once for the lanes that find the same roots; i >= n: nothing. All
/// lanes of a warp must call it.
template <typename Warp>
GRAUPEL_HD void join_times(const Warp& warp, const Groups& groups, int64_t i) {
  const int32_t a = i < groups.n ? groups.root(groups.node_of(0, i)) : 0;
  const int32_t b = i < groups.n ? groups.root(groups.node_of(1, i)) : 0;
  const unsigned open = warp.ballot(a != b);
  if (open == 0) return;
  const int first = grid::lowest_one(open);
  const int32_t first_a = warp.shuffle(a, first), first_b = warp.shuffle(b, first);
  if (a != b && (warp.lane() == first || a != first_a || b != first_b)) groups.unite(a, b);
}

}  // namespace graupel::graph::flight
