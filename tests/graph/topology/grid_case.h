// What the tests of grids share: clouds of particles, and the links of their grid on the host.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "graph/topology/grid_builder.h"

namespace graupel::graph {

inline constexpr double spacing = 0.07;
inline constexpr int levels = 4;

struct Cloud {
  SceneGrid grid;
  std::vector<Vec3f> position;
};

inline Cloud make_cloud(uint64_t seed, int64_t particles, const Vec3d& low, const Vec3d& high) {
  const Random random(seed, RandomPurpose::test);
  Cloud cloud{{low - Vec3d::filled(0.31), low, high, particles}, {}};
  for (uint64_t i = 0; i < static_cast<uint64_t>(particles); ++i) {
    Vec3f x;
    for (int d = 0; d < 3; ++d) x[d] = static_cast<float>(random.uniform(i, d, low[d], high[d]));
    cloud.position.push_back(x);
  }
  return cloud;
}

inline std::vector<Cloud> clouds() {
  return {make_cloud(1, 300, {-0.5, -0.2, -0.9}, {0.1, 0.3, -0.4}), make_cloud(2, 40, {0, 0, 0}, {1, 1, 1}),
          make_cloud(3, 1, {2, 2, 2}, {2.5, 2.1, 2.1})};
}

/// The arrays on the host.
struct HostLinks {
  GridCounts counts;
  std::vector<Vec3i> coordinate;
  std::vector<int32_t> neighbor, parent, octant, edge_begin, sender, receiver, slot, reverse, child_begin, child,
      children;
  std::vector<int32_t> cell, pair_begin, pair;
  std::vector<float> weight, offset;
  std::vector<int64_t> first_cell = {0}, first_edge = {0};
};

template <typename T>
std::vector<T> host_copy(Device device, const T* data, int64_t count) {
  std::vector<T> values(static_cast<std::size_t>(count));
  device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(T));
  return values;
}

inline std::vector<Vec3f> positions_of(const std::vector<Cloud>& all) {
  std::vector<Vec3f> position;
  for (const Cloud& cloud : all) position.insert(position.end(), cloud.position.begin(), cloud.position.end());
  return position;
}

/// Of a builder that is prepared for as many particles in these scenes.
inline HostLinks build_again(Device device, GridBuilder& builder, const std::vector<Vec3f>& position) {
  Buffer<Vec3f> on_device(device, 0);
  on_device.upload(position);
  builder.build(on_device.data());
  HostLinks host;
  host.counts = builder.counts();
  const GridLinks links = builder.links();
  for (std::size_t l = 0; l < levels; ++l) {
    host.first_cell.push_back(host.first_cell.back() + host.counts.cells[l]);
    host.first_edge.push_back(host.first_edge.back() + host.counts.edges[l]);
  }
  const int64_t cells = host.first_cell.back(), edges = host.first_edge.back();
  const auto n = static_cast<int64_t>(position.size());
  host.coordinate = host_copy(device, links.coordinate, cells);
  host.neighbor = host_copy(device, links.neighbor, 6 * cells);
  host.parent = host_copy(device, links.parent, host.first_cell[levels - 1]);
  host.octant = host_copy(device, links.octant, cells);
  host.edge_begin = host_copy(device, links.edge_begin, cells + 1);
  host.sender = host_copy(device, links.sender, edges);
  host.receiver = host_copy(device, links.receiver, edges);
  host.slot = host_copy(device, links.slot, edges);
  host.reverse = host_copy(device, links.reverse, edges);
  host.child_begin = host_copy(device, links.child_begin, cells + 1);
  host.child = host_copy(device, links.child, host.first_cell[levels - 1]);
  host.children = host_copy(device, links.children, 8 * cells);
  host.cell = host_copy(device, links.cell, 8 * n);
  host.weight = host_copy(device, links.weight, 8 * n);
  host.offset = host_copy(device, links.offset, 3 * n);
  host.pair_begin = host_copy(device, links.pair_begin, host.counts.cells[0] + 1);
  host.pair = host_copy(device, links.pair, 8 * n);
  return host;
}

inline HostLinks build_on(Device device, GridBuilder& builder, const std::vector<Cloud>& all) {
  std::vector<SceneGrid> grids;
  for (const Cloud& cloud : all) grids.push_back(cloud.grid);
  builder.prepare(grids);
  return build_again(device, builder, positions_of(all));
}

/// A fused multiply-add may change the last bit of an offset in f64, and so to which of two neighbouring f32 numbers it
/// is rounded. A weight is a product of three offsets or of 1 - offset, with two roundings of its own.
inline constexpr double offset_rounding = 0x1p-24;

}  // namespace graupel::graph
