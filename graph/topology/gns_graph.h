// The graph of GNS: particles in the order of the cells that they lie in, so that neighbours lie close in memory, and
// edges between all within the radius, each particle's edge to itself included.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/parallel/host_device.h"
#include "sparsegrid/radius_graph.h"

namespace graupel::graph {

/// Numbers that an edge starts from: (x_sender - x_receiver) / R and its length.
inline constexpr int edge_feature_count = 4;
GRAUPEL_HD inline void write_edge_features(const Vec3f& sender, const Vec3f& receiver, double radius, float* features) {
  const Vec3d d = (sender.cast<double>() - receiver.cast<double>()) * (1 / radius);
  for (int axis = 0; axis < 3; ++axis) features[axis] = static_cast<float>(d[axis]);
  features[3] = static_cast<float>(norm(d));
}
inline std::array<float, edge_feature_count> edge_features(const Vec3f& sender, const Vec3f& receiver, double radius) {
  std::array<float, edge_feature_count> features;
  write_edge_features(sender, receiver, radius, features.data());
  return features;
}

/// Rebuilt every frame.
struct GnsGraph {
  std::vector<int32_t> order;     ///< [n] particle of a sorted place
  std::vector<Vec3f> position;    ///< [n] in sorted order
  sparsegrid::RadiusGraph links;  ///< between sorted places
  std::vector<int32_t> receiver;  ///< [edges]

  void build(const std::vector<Vec3f>& unsorted, double radius);
  int32_t particles() const { return links.points(); }
};

}  // namespace graupel::graph
