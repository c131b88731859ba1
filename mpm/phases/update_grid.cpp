// Grid update: velocity from momentum, gravity, contact with obstacles, then with the walls, so that the walls hold.
#include "mpm/phases/phases.h"
#include "mpm/physics/node_update.h"

#if defined(__GNUC__) && !defined(__CUDA_ARCH__)
#define HOST_CALL __attribute__((noinline))
#else
#define HOST_CALL
#endif

namespace graupel::mpm {

namespace {

template <typename T, int D, bool moving>
struct UpdateNode {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t entry) const {
    T* node = view.nodes + entry * channels;
    const T mass = node[3];
    if (!(mass >= least_node_mass<T>)) {
      for (int c = 0; c < 3; ++c) node[c] = T(0);
      return;
    }
    const int32_t key = view.blocks.node_key[entry / nodes_per_block<D>];
    const int inside = static_cast<int>(entry % nodes_per_block<D>);
    const Vec<T, 3> v =
        updated_velocity<moving, D, T>(view, view.moving, key, inside, node_position<D>(view.grid, key, inside),
                                       Vec<T, 3>{node[0], node[1], node[2]}, mass, dt);
    for (int c = 0; c < 3; ++c) node[c] = v[c];
  }
};

/// A function of its own on the host, in the plane and in blocks that obstacles pass: in a loop the product dt g would
/// be rounded once for all nodes instead of being fused with the sum, and the last bits of a run would change.
template <typename Update>
struct Called {
  Update update;
  HOST_CALL GRAUPEL_HD void operator()(int64_t entry) const { update(entry); }
};

template <bool moving, typename T>
void update_nodes(const SolverView<T>& view, T dt) {
  if (view.dimensions == 2)
    launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<2>),
              Called<UpdateNode<T, 2, moving>>{{view, dt}}, Grain{1024});
  else
    launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<3>), UpdateNode<T, 3, moving>{view, dt},
              Grain{1024});
}

}  // namespace

template <typename T>
void update_grid(const SolverView<T>& view, T dt) {
  view.moving.count > 0 ? update_nodes<true>(view, dt) : update_nodes<false>(view, dt);
}

template <typename T>
void update_grid_block(const SolverView<T>& view, T dt, int64_t block) {
  const int64_t first = block * nodes_per_block<3>, end = first + nodes_per_block<3>;
  if (view.moving.count > 0) {
    const Called<UpdateNode<T, 3, true>> update{{view, dt}};
    for (int64_t entry = first; entry < end; ++entry) update(entry);
  } else {
    const UpdateNode<T, 3, false> update{view, dt};
    for (int64_t entry = first; entry < end; ++entry) update(entry);
  }
}

template <typename T>
bool touches_moving_obstacle(const SolverView<T>& view, int32_t key) {
  return any_within_reach(view.moving, node_position<3>(view.grid, key, 0),
                          node_position<3>(view.grid, key, nodes_per_block<3> - 1), view.grid.dx);
}

template bool touches_moving_obstacle<float>(const SolverView<float>&, int32_t);
template bool touches_moving_obstacle<double>(const SolverView<double>&, int32_t);
template void update_grid_block<float>(const SolverView<float>&, float, int64_t);
template void update_grid_block<double>(const SolverView<double>&, double, int64_t);
template void update_grid<float>(const SolverView<float>&, float);
template void update_grid<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
