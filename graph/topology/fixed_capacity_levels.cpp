#include "graph/topology/fixed_capacity_levels.h"

#include <algorithm>
#include <utility>

#include "core/parallel/parallel_for_in.h"
#include "core/system/error.h"

namespace graupel::graph {

namespace {

constexpr int corners = 8;

/// Item i of a level copies cell i, the end of the lists of cells, edge i and the children of coarse cell i, as far as
/// there are such.
struct PlaceLinks {
  int levels;
  int64_t first_item[most_levels + 1];
  int64_t cell_capacity[most_levels], edge_capacity[most_levels];
  int64_t particles;
  GridLinks grid;
  LevelGraph<int32_t*> to[most_levels];
  int32_t* counts;

  GRAUPEL_HD int32_t cells(int l) const { return grid.level_begin[l + 1] - grid.level_begin[l]; }
  GRAUPEL_HD int32_t edges(int l) const { return grid.edge_level[l + 1] - grid.edge_level[l]; }

  GRAUPEL_HD void operator()(int64_t item) const {
    bool fits = *grid.overflow == 0;
    for (int l = 0; l < levels; ++l) fits = fits && cells(l) <= cell_capacity[l] && edges(l) <= edge_capacity[l];
    if (item == 0) {
      for (int l = 0; l < levels; ++l) {
        counts[l] = fits ? cells(l) : 0;
        counts[most_levels + l] = fits ? edges(l) : 0;
      }
      counts[2 * most_levels] = fits ? static_cast<int32_t>(particles) : 0;
      counts[2 * most_levels + 1] = fits ? static_cast<int32_t>(corners * particles) : 0;
      counts[2 * most_levels + 2] = !fits;
    }
    if (!fits) return;
    int l = 0;
    while (item >= first_item[l + 1]) ++l;
    copy(l, static_cast<int32_t>(item - first_item[l]));
  }

  GRAUPEL_HD void copy(int l, int32_t i) const {
    const LevelGraph<int32_t*>& own = to[l];
    const int32_t first_cell = grid.level_begin[l], first_edge = grid.edge_level[l];
    if (i <= cells(l)) own.edge_begin[i] = grid.edge_begin[first_cell + i] - first_edge;
    if (i < cells(l)) {
      own.octant[i] = grid.octant[first_cell + i];
      if (l + 1 < levels) {
        own.parent[i] = grid.parent[first_cell + i];
        // All cells of a level are children of the next one: children are counted as cells are.
        own.child[i] = grid.child[first_cell + i];
      }
    }
    if (l + 1 < levels && i <= cells(l + 1))
      own.child_begin[i] = grid.child_begin[grid.level_begin[l + 1] + i] - first_cell;
    if (i < edges(l)) {
      own.sender[i] = grid.sender[first_edge + i];
      own.receiver[i] = grid.receiver[first_edge + i];
      own.slot[i] = grid.slot[first_edge + i];
    }
  }
};

}  // namespace

LevelCapacity LevelCapacity::for_counts(const GridCounts& counts) {
  constexpr int64_t least = 64;
  LevelCapacity capacity;
  capacity.levels = counts.levels;
  for (std::size_t l = 0; l < static_cast<std::size_t>(counts.levels); ++l) {
    capacity.cells[l] = counts.cells[l] + counts.cells[l] / 2 + least;
    capacity.edges[l] = counts.edges[l] + counts.edges[l] / 2 + 6 * least;
  }
  return capacity;
}

bool LevelCapacity::holds(const GridCounts& counts) const {
  for (std::size_t l = 0; l < static_cast<std::size_t>(levels); ++l)
    if (counts.cells[l] > cells[l] || counts.edges[l] > edges[l]) return false;
  return counts.levels == levels;
}

void FixedCapacityLevels::prepare(const LevelCapacity& capacity) {
  capacity_ = capacity;
  const auto cells_above = [&](std::size_t l) {
    return l + 1 < static_cast<std::size_t>(capacity.levels) ? capacity.cells[l + 1] : 0;
  };
  int64_t numbers = 0;
  for (std::size_t l = 0; l < static_cast<std::size_t>(capacity.levels); ++l)
    numbers += 4 * capacity.cells[l] + 1 + 3 * capacity.edges[l] + cells_above(l) + 1;
  numbers_.resize_discard(static_cast<std::size_t>(numbers));
  int32_t* place = numbers_.data();
  const auto take = [&](int64_t size) { return std::exchange(place, place + size); };
  for (std::size_t l = 0; l < static_cast<std::size_t>(capacity.levels); ++l) {
    const int64_t cells = capacity.cells[l], edges = capacity.edges[l];
    level_[l] = {.cells = cells,
                 .edges = edges,
                 .edge_begin = take(cells + 1),
                 .sender = take(edges),
                 .receiver = take(edges),
                 .slot = take(edges),
                 .parent = take(cells),
                 .octant = take(cells),
                 .child_begin = take(cells_above(l) + 1),
                 .child = take(cells)};
  }
}

void FixedCapacityLevels::place(const GridLinks& grid, int64_t particles, void* stream) {
  GRAUPEL_ASSERT(capacity_.levels > 0);
  PlaceLinks body{};
  body.levels = capacity_.levels;
  for (int l = 0; l < capacity_.levels; ++l) {
    const auto at = static_cast<std::size_t>(l);
    body.cell_capacity[l] = capacity_.cells[at];
    body.edge_capacity[l] = capacity_.edges[at];
    body.to[l] = level_[at];
    int64_t items = std::max(capacity_.cells[at] + 1, capacity_.edges[at]);
    if (l + 1 < capacity_.levels) items = std::max(items, capacity_.cells[at + 1] + 1);
    body.first_item[l + 1] = body.first_item[l] + items;
  }
  body.particles = particles;
  body.grid = grid;
  body.counts = counts_.data();
  parallel_for_in(stream, device_, body.first_item[capacity_.levels], body);
}

LevelLinks FixedCapacityLevels::level(int l) const {
  const auto pointer = [](int32_t* array) -> const int32_t* { return array; };
  return {level_[static_cast<std::size_t>(l)].as<const int32_t*>(pointer), counts_.data() + l,
          counts_.data() + most_levels + l};
}

}  // namespace graupel::graph
