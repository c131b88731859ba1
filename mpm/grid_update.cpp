// Grid update: velocity from momentum, gravity, contact with obstacles, then with the walls, so that the walls hold.
#include "mpm/node_update.h"
#include "mpm/phases.h"

namespace graupel::mpm {

namespace {

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

/// The law of the deeper one of the obstacles at rest and the moving ones. Contact is judged in the obstacle's frame:
/// the velocity of the material relative to the obstacle's point there.
template <bool moving, int D, typename T>
GRAUPEL_HD inline Vec<T, 3> meet_obstacles(const SolverView<T>& view, int32_t key, int inside, const Vec<T, 3>& x,
                                           const Vec<T, 3>& v) {
  const int32_t surface = view.obstacle_nodes.block_number[key];
  const int64_t entry = int64_t(surface) * nodes_per_block<D> + inside;
  if (moving) {
    sparsegrid::SignedDistance<T> here{};
    const int32_t index = holding_obstacle<D>(view.moving, x, view.grid.dx, here);
    const bool fixed_is_deeper = surface != block_without_surface && view.obstacle_nodes.law[entry] >= 0 &&
                                 view.obstacle_nodes.phi[entry] <= here.phi;
    if (index >= 0 && !fixed_is_deeper) {
      const Vec<T, 3> u = view.moving.step[index].velocity_at(x);
      if (norm2(here.normal) == T(0)) return u;
      const sparsegrid::ObstacleView& obstacle = view.moving.start.obstacles[index];
      return u + apply_contact(obstacle.contact, static_cast<T>(obstacle.friction), here.normal, v - u);
    }
  }
  return surface != block_without_surface ? meet_fixed_obstacle(view.obstacle_nodes, entry, v) : v;
}

template <typename T, int D, bool moving>
struct UpdateNode {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t entry) const {
    T* node = view.nodes + entry * channels;
    const T mass = node[3];
    if (!(mass > T(0))) {
      for (int c = 0; c < 3; ++c) node[c] = T(0);
      return;
    }
    const int32_t key = view.blocks.node_key[entry / nodes_per_block<D>];
    const int inside = static_cast<int>(entry % nodes_per_block<D>);
    Vec<T, 3> v = Vec<T, 3>{node[0], node[1], node[2]} * (T(1) / mass) + dt * view.gravity;
    const Vec<T, 3> x = node_position<D>(view.grid, key, inside);
    v = meet_obstacles<moving, D>(view, key, inside, x, v);
    v = meet_walls(view.walls, x, view.grid.dx, v);
    for (int c = 0; c < 3; ++c) node[c] = v[c];
  }
};

template <int D, typename T>
void update_nodes(const SolverView<T>& view, T dt) {
  const int64_t nodes = view.blocks.node_count * int64_t(nodes_per_block<D>);
  if (view.moving.count > 0)
    launch<T>(view.device, nodes, UpdateNode<T, D, true>{view, dt}, Grain{1024});
  else
    launch<T>(view.device, nodes, UpdateNode<T, D, false>{view, dt}, Grain{1024});
}

}  // namespace

template <typename T>
void update_grid(const SolverView<T>& view, T dt) {
  view.dimensions == 2 ? update_nodes<2>(view, dt) : update_nodes<3>(view, dt);
}

template <typename T>
void update_grid_block(const SolverView<T>& view, T dt, int64_t block) {
  const int64_t first = block * nodes_per_block<3>, end = first + nodes_per_block<3>;
  if (view.moving.count > 0) {
    const UpdateNode<T, 3, true> update{view, dt};
    for (int64_t entry = first; entry < end; ++entry) update(entry);
  } else {
    const UpdateNode<T, 3, false> update{view, dt};
    for (int64_t entry = first; entry < end; ++entry) update(entry);
  }
}

template <typename T>
bool meets_moving_obstacle(const SolverView<T>& view, int32_t key) {
  const Vec<T, 3> low = node_position<3>(view.grid, key, 0),
                  high = node_position<3>(view.grid, key, nodes_per_block<3> - 1);
  for (int32_t i = 0; i < view.moving.count; ++i)
    if (within_reach(view.moving.start.obstacles[view.moving.index[i]], low, high, view.grid.dx)) return true;
  return false;
}

template bool meets_moving_obstacle<float>(const SolverView<float>&, int32_t);
template bool meets_moving_obstacle<double>(const SolverView<double>&, int32_t);
template void update_grid_block<float>(const SolverView<float>&, float, int64_t);
template void update_grid_block<double>(const SolverView<double>&, double, int64_t);
template void update_grid<float>(const SolverView<float>&, float);
template void update_grid<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
