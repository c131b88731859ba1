// The links of a grid's levels at places that do not move from frame to frame, with their numbers in the device's
// memory: what a recorded forward pass reads. For one scene.
#pragma once

#include <array>
#include <cstdint>

#include "core/parallel/buffer.h"
#include "graph/topology/grid_builder.h"
#include "graph/topology/level_graph.h"

namespace graupel::graph {

/// Room for the cells and edges of each level.
struct LevelCapacity {
  int levels = 0;
  std::array<int64_t, most_levels> cells{}, edges{};
  /// Room for `counts`, and half as much again for frames to come.
  static LevelCapacity for_counts(const GridCounts& counts);
  bool holds(const GridCounts& counts) const;
};

class FixedCapacityLevels {
 public:
  explicit FixedCapacityLevels(Device device)
      : device_(device), numbers_(device, 0), counts_(device, 2 * most_levels + 3) {}

  /// Allocates the capacity; what was placed is lost.
  void prepare(const LevelCapacity& capacity);
  /// Copies the links of a grid of one scene; launches alone. Where they do not fit, or the grid has overflowed, every
  /// count becomes 0, so that what runs on them does nothing, and fault() is set.
  void place(const GridLinks& grid, int64_t particles, void* stream = nullptr);

  /// Without reverse edges; `cells` and `edges` are capacities.
  LevelLinks level(int l) const;
  const int32_t* particle_count() const { return counts_.data() + 2 * most_levels; }
  const int32_t* pair_count() const { return particle_count() + 1; }  ///< eight a particle
  const int32_t* fault() const { return particle_count() + 2; }

 private:
  Device device_;
  LevelCapacity capacity_;
  std::array<LevelGraph<int32_t*>, most_levels> level_{};
  Buffer<int32_t> numbers_;  ///< all arrays
  Buffer<int32_t> counts_;   ///< cells, edges of every level; particles, pairs; fault
};

}  // namespace graupel::graph
