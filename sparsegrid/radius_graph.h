// Edges between all points that are no farther apart than a radius (GNS, Sanchez-Gonzalez et al. 2020, section 3.2).
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::sparsegrid {

enum class SelfEdges { without, with };

/// Directed edges by receiver: sender[begin[r]] to sender[begin[r + 1] - 1] send to r, ascending. Every edge has its
/// reverse, so that the list is that of the receivers of a sender, too.
struct RadiusGraph {
  std::vector<int32_t> begin = {0};  ///< [n + 1]
  std::vector<int32_t> sender;       ///< [edges]
  int32_t points() const { return static_cast<int32_t>(begin.size()) - 1; }
  int64_t edges() const { return static_cast<int64_t>(sender.size()); }
};

/// All pairs with |x_s - x_r| <= `radius` [m], the radius rounded to float. The same on any number of threads. Throws
/// ConfigError for a radius that is not positive or a point beyond 2^20 radii, InputError for 2^31 edges or more.
RadiusGraph build_radius_graph(const std::vector<Vec3f>& position, double radius, SelfEdges self);

}  // namespace graupel::sparsegrid
