#include "sparsegrid/obstacle_cells.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sparsegrid/obstacle.h"

namespace graupel::sparsegrid {

namespace {

constexpr double cells_per_obstacle = 32;
constexpr int64_t most_entries = 1 << 20, most_entries_per_obstacle = 128;  ///< cells and entries of their lists

/// First and last cell along each axis.
struct CellRange {
  Vec<int, 3> low, high;
  int64_t count() const {
    int64_t n = 1;
    for (int d = 0; d < 3; ++d) n *= std::max(0, high[d] - low[d] + 1);
    return n;
  }
};

/// The cells where a look-up in precision T reads the obstacle's grid, or pushes out of it.
template <typename T>
void widen(CellRange& range, const ObstacleCells& cells, const ObstacleFrame<T>& frame) {
  for (int d = 0; d < 3; ++d) {
    if (frame.low[d] <= frame.high[d]) {
      range.low[d] = std::min(range.low[d], cells.along(d, frame.low[d]));
      range.high[d] = std::max(range.high[d], cells.along(d, frame.high[d]));
    }
    if (frame.solid_low[d] <= frame.solid_high[d]) {
      range.low[d] = std::min(range.low[d], cells.along(d, frame.solid_low[d]));
      range.high[d] = std::max(range.high[d], cells.along(d, frame.solid_high[d]));
    }
  }
}

CellRange range_of(const ObstacleCells& cells, const ObstacleView& obstacle, bool moves) {
  if (moves) return {Vec<int, 3>::filled(0), cells.size - Vec<int, 3>::filled(1)};
  CellRange range = {cells.size, Vec<int, 3>::filled(-1)};
  widen(range, cells, obstacle.exact);
  widen(range, cells, obstacle.single);
  return range;
}

/// Cells of an edge [m] over the box from `low` on.
void place_cells(ObstacleCells& cells, const Vec3d& low, const Vec3d& extent, double spacing) {
  cells.exact.origin = low;
  cells.exact.inverse_spacing = 1 / spacing;
  cells.single.origin = low.cast<float>();
  cells.single.inverse_spacing = static_cast<float>(1 / spacing);
  for (int d = 0; d < 3; ++d) cells.size[d] = std::max(1, static_cast<int>(std::ceil(extent[d] / spacing)));
}

template <typename Body>
void for_each_cell(const ObstacleCells& cells, const CellRange& range, Body&& body) {
  for (int z = range.low[2]; z <= range.high[2]; ++z)
    for (int y = range.low[1]; y <= range.high[1]; ++y)
      for (int x = range.low[0]; x <= range.high[0]; ++x)
        body(static_cast<std::size_t>((z * cells.size[1] + y) * cells.size[0] + x));
}

void fill_lists(ObstacleLists& lists, const std::vector<CellRange>& ranges, int64_t cells) {
  lists.begin.assign(static_cast<std::size_t>(cells) + 1, 0);
  for (const CellRange& range : ranges)
    for_each_cell(lists.cells, range, [&](std::size_t cell) { ++lists.begin[cell + 1]; });
  std::partial_sum(lists.begin.begin(), lists.begin.end(), lists.begin.begin());
  std::vector<int32_t> end(lists.begin.begin(), lists.begin.end() - 1);
  lists.place.resize(static_cast<std::size_t>(lists.begin.back()));
  for (std::size_t i = 0; i < ranges.size(); ++i)
    for_each_cell(lists.cells, ranges[i], [&](std::size_t cell) {
      lists.place[static_cast<std::size_t>(end[cell]++)] = static_cast<int32_t>(i);
    });
}

}  // namespace

ObstacleLists list_obstacles(const std::vector<ObstacleView>& obstacles, const std::vector<bool>& moves,
                             const Vec3d& low, const Vec3d& high) {
  ObstacleLists lists;
  const std::size_t n = obstacles.size();
  Vec3d extent = high - low;
  const double longest = std::max({extent[0], extent[1], extent[2]});
  if (n < fewest_listed_obstacles || !(longest > 0) || !std::isfinite(longest)) return lists;
  for (int d = 0; d < 3; ++d) extent[d] = std::max(extent[d], 1e-3 * longest);
  double spacing = std::cbrt(extent[0] * extent[1] * extent[2] / (cells_per_obstacle * static_cast<double>(n)));
  std::vector<CellRange> ranges(n);
  const int64_t most = most_entries + most_entries_per_obstacle * static_cast<int64_t>(n);
  for (;; spacing *= 1.5) {
    place_cells(lists.cells, low, extent, spacing);
    const int64_t cells = CellRange{Vec<int, 3>::filled(1), lists.cells.size}.count();
    int64_t entries = 0;
    for (std::size_t i = 0; i < n; ++i) entries += (ranges[i] = range_of(lists.cells, obstacles[i], moves[i])).count();
    if (cells + entries > most && cells > 1) continue;
    if (2 * entries <= cells * static_cast<int64_t>(n)) fill_lists(lists, ranges, cells);
    return lists;
  }
}

}  // namespace graupel::sparsegrid
