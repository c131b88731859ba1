// The grid hierarchy of a batch of scenes (sparsegrid/hierarchy.h, HGN paper, section 3.2), built where its network
// runs: the active cells of every level are bits of a box of cells, a cell's number counts the bits before its own.
// Cells of a level are numbered scene by scene, within a scene by (z, y, x), as those of sparsegrid::build_hierarchy.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "core/parallel/buffer.h"
#include "graph/topology/device_lists.h"

namespace graupel::graph {

/// Where the cells of one scene may lie.
struct SceneGrid {
  Vec3d origin;       ///< of the grid [m]
  Vec3d low, high;    ///< [m] box that holds the particles, give or take `margin` cells
  int64_t particles;  ///< of this scene; scenes follow each other
};

inline constexpr int most_levels = 8;

/// Arrays that say who is linked to whom, in the device's memory. Those of cells hold all levels, one after the other,
/// finest first: cell c of level l is at level_begin[l] + c. Numbers of cells and edges count within a level.
struct GridLinks {
  const int32_t* level_begin;  ///< [levels + 1] first cell of each level
  const int32_t* edge_level;   ///< [levels + 1] first edge of each level
  const Vec3i* coordinate;     ///< [cells]
  const int32_t* neighbor;     ///< [cells, 6] -x, +x, -y, +y, -z, +z; -1 for none
  const int32_t* parent;       ///< [cells] cell of the next level; unset at the top
  const int32_t* octant;       ///< [cells] child slot, 0..7
  const int32_t* edge_begin;   ///< [cells + 1] edges by receiver, counted over all levels
  const int32_t* sender;       ///< [edges]
  const int32_t* receiver;     ///< [edges]
  const int32_t* slot;         ///< [edges] 0..5: the sender lies at -x, +x, -y, +y, -z, +z
  const int32_t* reverse;      ///< [edges] the edge from receiver to sender, counted within the level
  const int32_t* child_begin;  ///< [cells + 1] children by parent, counted over all levels; level 0 has none
  const int32_t* child;        ///< [children] cell of the finer level
  const int32_t* children;     ///< [cells, 8] the same by child slot; -1 for none
  const int32_t* cell;         ///< [particles, 8] level-0 cells; corner bit d: upper along axis d
  const float* weight;         ///< [particles, 8] trilinear, sum 1
  const float* offset;         ///< [particles, 3] (x - centre of corner 0) / spacing
  const int32_t* pair_begin;   ///< [level-0 cells + 1] pairs by cell
  const int32_t* pair;         ///< [particles * 8] particle * 8 + corner, in this order within a cell
  const int32_t* overflow;     ///< GridCounts::overflow
};

/// Counts of one build, on the host.
struct GridCounts {
  int levels = 0;
  std::array<int64_t, most_levels> cells{}, edges{};
  bool overflow = false;  ///< a particle lay outside the boxes: the links are of no use
};

struct GridProgram;
/// Makes a grid in one launch, but for its edges (graph/topology/grid_at_once.h), in a stream.
using GridLaunch = std::function<void(const GridProgram&, void* stream)>;

class GridBuilder {
 public:
  /// Grids of `levels` levels (at most most_levels), the finest of `spacing` [m]; boxes are widened by `margin` cells.
  /// Without edges their lists and those of children are not made, and are counted as none. `at_once` makes every grid;
  /// without it, a GPU does so in one launch where that is faster.
  GridBuilder(Device device, double spacing, int levels, int margin = 3, bool with_edges = true,
              GridLaunch at_once = {});
  ~GridBuilder();

  /// Boxes and memory for these scenes. Throws ConfigError when a box has
  /// more than 2^30 cells.
  void prepare(const std::vector<SceneGrid>& scenes, void* stream = nullptr);
  /// Links for `position` [particles] in the device's memory; launches alone, nothing is waited for.
  void build(const Vec3f* position, void* stream = nullptr, bool with_counts = true);
  /// Counts of the last build with counts; waits for it.
  GridCounts counts(void* stream = nullptr) const;
  GridLinks links() const;

 private:
  struct Arrays;

  Device device_;
  double spacing_;
  int levels_, margin_, scenes_ = 0;
  bool with_edges_;
  GridLaunch wanted_launch_, launch_;  ///< of the constructor; of the scenes at hand, or none
  int64_t particles_ = 0;
  int64_t words_ = 0, fine_words_ = 0;        ///< of bits; of those of level 0
  int64_t most_cells_ = 0, most_level0_ = 0;  ///< that particles and boxes allow
  std::unique_ptr<Arrays> arrays_;
};

}  // namespace graupel::graph
