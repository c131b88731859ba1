#include "mpm/grid/obstacle_nodes.h"

namespace graupel::mpm {

namespace {

using sparsegrid::ObstacleSetView;
using sparsegrid::signed_distance;

/// A particle is at most 0.87 dx from its nearest node, moves at most dx in a substep, and phi is off by part of a
/// voxel.
constexpr double particle_reach = 2.4;

/// Whether a block may have nodes within reach of a surface, or particles that look at such nodes.
template <typename T>
struct FindSurfaceBlocks {
  GridGeometry<T, 3> grid;
  ObstacleSetView obstacles;
  int32_t* found;
  GRAUPEL_HD void operator()(int64_t index) const {
    found[index] = 0;
    if (obstacles.count == 0) return;
    const Vec<int, 3> block = grid.block_of(static_cast<int32_t>(index));
    Vec<T, 3> centre;
    for (int d = 0; d < 3; ++d) centre[d] = grid.origin[d] + (T(block_width) * T(block[d]) + T(1.5)) * grid.dx;
    int nearest;
    const T phi = signed_distance(obstacles, centre, nearest).phi;
    // Half diagonal of the block 2.6 dx, and the reach of a particle that looks at its nearest node.
    found[index] = phi < (T(2.6) + T(particle_reach)) * grid.dx ? 1 : 0;
  }
};

template <typename T, int D>
struct EvaluateNodes {
  GridGeometry<T, 3> grid;
  ObstacleSetView obstacles;
  const int32_t* keys;
  T* phi;
  Vec<T, 3>* normal;
  int32_t* law;
  GRAUPEL_HD void operator()(int64_t entry) const {
    const Vec<T, 3> x =
        node_position<D>(grid, keys[entry / nodes_per_block<D>], static_cast<int>(entry % nodes_per_block<D>));
    int nearest;
    auto here = signed_distance(obstacles, x, nearest);
    here.normal = normal_in_axes<D>(here.normal);
    phi[entry] = here.phi;
    normal[entry] = here.normal;
    bool holds = here.phi < T(0);
    if (!holds && here.phi < T(0.5) * grid.dx) {
      int other;
      holds = signed_distance(obstacles, x - grid.dx * here.normal, other).phi > T(0);
    }
    law[entry] = holds ? nearest : -1;
  }
};

}  // namespace

template <typename T>
ObstacleNodes<T>::ObstacleNodes(Device device, const GridGeometry<T, 3>& grid, const ObstacleSetView& obstacles,
                                int dimensions)
    : obstacles_(obstacles),
      block_number_(device, static_cast<std::size_t>(grid.directory_size())),
      law_(device, 0),
      phi_(device, 0),
      normal_(device, 0) {
  launch<T>(device, grid.directory_size(), FindSurfaceBlocks<T>{grid, obstacles_, block_number_.data()}, Grain{64});
  // In place on the CPU: of a large domain this is the largest array of a run.
  std::vector<int32_t> copy, keys;
  if (device != Device::cpu) copy = block_number_.download();
  int32_t* number = device == Device::cpu ? block_number_.data() : copy.data();
  for (std::size_t i = 0; i < block_number_.size(); ++i) {
    const bool surface = number[i] != 0;
    number[i] = surface ? static_cast<int32_t>(keys.size()) : block_without_surface;
    if (surface) keys.push_back(static_cast<int32_t>(i));
  }
  if (device != Device::cpu) block_number_.upload(copy);
  Buffer<int32_t> key_buffer(device, 0);
  key_buffer.upload(keys);
  const std::size_t entries =
      keys.size() * static_cast<std::size_t>(dimensions == 2 ? nodes_per_block<2> : nodes_per_block<3>);
  law_.resize_discard(entries);
  phi_.resize_discard(entries);
  normal_.resize_discard(entries);
  const auto evaluate = [&](auto kernel) {
    launch<T>(device, static_cast<int64_t>(entries),
              decltype(kernel){grid, obstacles_, key_buffer.data(), phi_.data(), normal_.data(), law_.data()},
              Grain{64});
  };
  dimensions == 2 ? evaluate(EvaluateNodes<T, 2>{}) : evaluate(EvaluateNodes<T, 3>{});
  synchronize(device);
}

template <typename T>
ObstacleNodeView<T> ObstacleNodes<T>::view() const {
  return {obstacles_, block_number_.data(), phi_.data(), normal_.data(), law_.data()};
}

template <typename T>
int64_t ObstacleNodes<T>::bytes() const {
  return static_cast<int64_t>(block_number_.size() * 4 + law_.size() * 4 + phi_.size() * sizeof(T) * 4);
}

template class ObstacleNodes<float>;
template class ObstacleNodes<double>;

}  // namespace graupel::mpm
