// The graph of GNS: particles in the order of the cells that they lie in, so that neighbours lie close in memory, and
// edges between all within the radius, each particle's edge to itself included.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "sparsegrid/radius_graph.h"

namespace graupel::graph {

/// Numbers that an edge starts from: (x_sender - x_receiver) / R and its length.
inline constexpr int edge_feature_count = 4;
inline std::array<float, edge_feature_count> edge_features(const Vec3f& sender, const Vec3f& receiver, double radius) {
  const Vec3d d = (sender.cast<double>() - receiver.cast<double>()) * (1 / radius);
  return {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2]), static_cast<float>(norm(d))};
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
