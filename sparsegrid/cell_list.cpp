#include "sparsegrid/cell_list.h"

#include <cmath>
#include <numeric>
#include <string>

#include "core/system/error.h"

namespace graupel::sparsegrid {

namespace {

constexpr int coordinate_limit = (1 << 20) - 2;  ///< leaves room for a neighbour

/// Cells of the points and the box around them.
struct Places {
  std::vector<Vec3i> cell;
  Vec3i low = Vec3i::zero(), high = Vec3i::zero();

  Places(const std::vector<Vec3f>& position, double size) : cell(position.size()) {
    const double inverse = 1 / size;
    for (std::size_t p = 0; p < position.size(); ++p)
      for (int d = 0; d < 3; ++d) {
        const double u = std::floor(static_cast<double>(position[p][d]) * inverse);
        if (!(std::abs(u) < coordinate_limit))
          throw ConfigError("a particle is too far from the origin (particle " + std::to_string(p) + ", " +
                            std::to_string(position[p][d]) + " m, at most 2^20 cells of " + std::to_string(size) +
                            " m). Check the positions or choose a larger radius");
        const int i = static_cast<int>(u);
        cell[p][d] = i;
        low[d] = p == 0 ? i : std::min(low[d], i);
        high[d] = p == 0 ? i : std::max(high[d], i);
      }
  }
};

CellTable<3> table_of(const Places& places) {
  CellTable<3> table(places.low, places.high, places.cell.size());
  for (const Vec3i& cell : places.cell) table.insert(cell);
  return table;
}

}  // namespace

CellList::CellList(const std::vector<Vec3f>& position, double size)
    : size_(size), table_(Vec3i::zero(), Vec3i::zero(), 0), begin_(1, 0) {
  if (!(size > 0)) throw ConfigError("the cell size is not positive (" + std::to_string(size) + " m)");
  if (position.empty()) return;
  const Places places(position, size);
  table_ = table_of(places);
  cell_ = table_.number_cells();
  begin_.assign(cell_.size() + 1, 0);
  cell_of_.resize(position.size());
  for (std::size_t p = 0; p < position.size(); ++p) {
    cell_of_[p] = table_.find(places.cell[p]);
    ++begin_[static_cast<std::size_t>(cell_of_[p]) + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<int32_t> cursor(begin_.begin(), begin_.end() - 1);
  point_.resize(position.size());
  for (std::size_t p = 0; p < position.size(); ++p)
    point_[static_cast<std::size_t>(cursor[static_cast<std::size_t>(cell_of_[p])]++)] = static_cast<int32_t>(p);
}

}  // namespace graupel::sparsegrid
