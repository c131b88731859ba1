// Periodic walls: nodes one period apart are the same node. Particles within a cell of a wall reach nodes beyond it, so
// that three layers of nodes at each end of a periodic axis have an image at the other end, for both splines (a cubic
// stencil's fourth node beyond an end has weight zero there); after the particles' sums
// each of them takes the sum over all its images, in an order that is the same for all.
#include "mpm/phases/phases.h"

namespace graupel::mpm {

namespace {

template <typename T, int D>
struct JoinNode {
  SolverView<T> view;
  T* joined;

  GRAUPEL_HD void operator()(int64_t entry) const {
    const int32_t key = view.blocks.node_key[entry / nodes_per_block<D>];
    const Vec<int, D> block = in_axes<D>(view.grid).block_of(key);
    Vec<int, D> low = node_in_block<D>(static_cast<int>(entry % nodes_per_block<D>));
    int images[3] = {1, 1, 1};
    for (int d = 0; d < D; ++d) {
      low[d] += block_width * block[d];
      images[d] = image_of_low_end(d, low[d]) ? 2 : 1;
    }
    T sum[channels] = {};
    for (int x = 0; x < images[0]; ++x)
      for (int y = 0; y < images[1]; ++y)
        for (int z = 0; z < images[2]; ++z) add(low, in_axes<D>(Vec<int, 3>{x, y, z}), sum);
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

  GRAUPEL_HD void add(const Vec<int, D>& low, const Vec<int, D>& image, T (&sum)[channels]) const {
    Vec<int, D> block;
    int inside = 0;
    for (int d = 0; d < D; ++d) {
      const int node = low[d] + image[d] * view.walls.periodic[d].cells;
      block[d] = node / block_width;
      inside = inside * block_width + node % block_width;
    }
    const int32_t number = view.blocks.node_of_key[in_axes<D>(view.grid).directory_index(block)];
    if (number < 0) return;
    const T* from = view.nodes + (int64_t(number) * nodes_per_block<D> + inside) * channels;
    for (int c = 0; c < channels; ++c) sum[c] += from[c];
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
