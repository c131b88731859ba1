// Periodic walls: nodes one period apart are the same node. Particles within a cell of a wall reach nodes beyond it, so
// that three layers of nodes at each end of a periodic axis have an image at the other end; after the particles' sums
// each of them takes the sum over all its images, in an order that is the same for all.
#include "mpm/phases.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct JoinNode {
  SolverView<T> view;
  T* joined;

  GRAUPEL_HD void operator()(int64_t entry) const {
    const int32_t key = view.blocks.node_key[entry / nodes_per_block<3>];
    const Vec<int, 3> block = view.grid.block_of(key);
    Vec<int, 3> low = node_in_block<3>(static_cast<int>(entry % nodes_per_block<3>));
    int images[3];
    for (int d = 0; d < 3; ++d) {
      low[d] += block_width * block[d];
      images[d] = image_of_low_end(d, low[d]) ? 2 : 1;
    }
    T sum[channels] = {};
    for (int x = 0; x < images[0]; ++x)
      for (int y = 0; y < images[1]; ++y)
        for (int z = 0; z < images[2]; ++z) add(low, {x, y, z}, sum);
    for (int c = 0; c < channels; ++c) joined[entry * channels + c] = sum[c];
  }

  /// Whether a node has an image along an axis; it is then replaced by that at the lower end.
  GRAUPEL_HD bool image_of_low_end(int axis, int& node) const {
    const PeriodicAxis& p = view.walls.periodic[axis];
    if (p.cells == 0) return false;
    const int from_low = node - p.low_node, from_high = from_low - p.cells;
    if (from_high >= -1 && from_high <= 1) node -= p.cells;
    return (from_low >= -1 && from_low <= 1) || (from_high >= -1 && from_high <= 1);
  }

  GRAUPEL_HD void add(const Vec<int, 3>& low, const Vec<int, 3>& image, T (&sum)[channels]) const {
    Vec<int, 3> block;
    int inside = 0;
    for (int d = 0; d < 3; ++d) {
      const int node = low[d] + image[d] * view.walls.periodic[d].cells;
      block[d] = node / block_width;
      inside = inside * block_width + node % block_width;
    }
    const int32_t number = view.blocks.node_of_key[view.grid.directory_index(block)];
    if (number < 0) return;
    const T* from = view.nodes + (int64_t(number) * nodes_per_block<3> + inside) * channels;
    for (int c = 0; c < channels; ++c) sum[c] += from[c];
  }
};

}  // namespace

template <typename T>
void join_periodic(const SolverView<T>& view, T* joined) {
  launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<3>), JoinNode<T>{view, joined}, Grain{1024});
}

template void join_periodic<float>(const SolverView<float>&, float*);
template void join_periodic<double>(const SolverView<double>&, double*);

}  // namespace graupel::mpm
