// The grid update of every node in use (mpm/node_update.h).
#include "mpm/node_update.h"

#include "mpm/phases.h"

namespace graupel::mpm {

namespace {

template <typename T>
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
    const Vec<T, 3> v =
        updated_velocity<T>(view, view.blocks.node_key[entry / nodes_per_block<3>],
                            static_cast<int>(entry % nodes_per_block<3>), {node[0], node[1], node[2]}, mass, dt);
    for (int c = 0; c < 3; ++c) node[c] = v[c];
  }
};

}  // namespace

template <typename T>
void update_grid(const SolverView<T>& view, T dt) {
  launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<3>), UpdateNode<T>{view, dt}, Grain{1024});
}

template void update_grid<float>(const SolverView<float>&, float);
template void update_grid<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
