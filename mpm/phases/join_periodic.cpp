// Periodic walls: nodes one period apart are the same node. After the particles' sums each of them takes the sum over
// all its images, in an order that is the same for all.
#include "mpm/phases/periodic_nodes.h"

namespace graupel::mpm {

namespace {

template <typename T, int D>
struct JoinNode {
  SolverView<T> view;
  T* joined;

  GRAUPEL_HD void operator()(int64_t entry) const {
    T sum[channels] = {};
    for_images<D>(view, view.blocks.node_key[entry / nodes_per_block<D>], static_cast<int>(entry % nodes_per_block<D>),
                  [&](int64_t image) {
                    const T* from = view.nodes + image * channels;
                    for (int c = 0; c < channels; ++c) sum[c] += from[c];
                  });
    for (int c = 0; c < channels; ++c) joined[entry * channels + c] = sum[c];
  }
};

}  // namespace

template <typename T>
void join_periodic(const SolverView<T>& view, T* joined) {
  const int64_t blocks = view.blocks.node_count;
  if (view.dimensions == 2)
    launch<T>(view.device, blocks * nodes_per_block<2>, JoinNode<T, 2>{view, joined}, Grain{1024});
  else
    launch<T>(view.device, blocks * nodes_per_block<3>, JoinNode<T, 3>{view, joined}, Grain{1024});
}

template void join_periodic<float>(const SolverView<float>&, float*);
template void join_periodic<double>(const SolverView<double>&, double*);

}  // namespace graupel::mpm
