// Features of the edges of GNS, between all particles within the radius (graph/topology/graph_topology.h).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/math/vec.h"
#include "core/parallel/host_device.h"

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

}  // namespace graupel::graph
