// The cells of a density projection: all of the box that holds the particles, in memory whether they hold matter or
// not.
#pragma once

#include <cmath>

#include "core/system/error.h"
#include "graph/corrections/density_kernels.h"

namespace graupel::graph::density {

inline constexpr int64_t most_cells = int64_t{1} << 26;
inline constexpr int border = 2;  ///< [cells] around the walls
/// Open fractions, mass, pressure, and bits with their ranks.
inline constexpr double bytes_of_cell = sizeof(OpenFractions) + 2 * sizeof(float) + 2.0 * sizeof(float) / word_bits;

/// Cells over the box low .. high [m], whose corner is `shift` cells below; `spacing` [m] is doubled until there are at
/// most most_cells, so that places of faces and cells fit into 32 bits.
inline Cells cells_over(const Vec3d& low, const Vec3d& high, double spacing, double shift) {
  Cells cells{};
  double count = 0;
  do {
    count = 1;
    for (int d = 0; d < 3; ++d) {
      const double size = std::ceil((high[d] - low[d]) / spacing + shift) + 2 * border;
      count *= d == 0 ? size + 1 : size;
      if (count > most_cells) break;
      cells.origin[d] = low[d] - (border + shift) * spacing;
      cells.size[d] = static_cast<int>(size);
    }
    cells.spacing = spacing;
    cells.inverse_spacing = 1 / spacing;
    spacing *= 2;
  } while (count > most_cells);
  cells.size[0] += cells.size[0] & 1;
  return cells;
}

/// Throws ConfigError when the cells do not fit into `available` bytes.
inline void check_fits(const Cells& cells, uint64_t available) {
  const double bytes = bytes_of_cell * static_cast<double>(cells.count());
  if (bytes <= static_cast<double>(available)) return;
  throw ConfigError("the density projection does not fit into the memory (" + std::to_string(1e-9 * bytes) +
                    " GB needed for " + std::to_string(cells.count()) + " cells of " + std::to_string(cells.spacing) +
                    " m, " + std::to_string(1e-9 * static_cast<double>(available)) +
                    " GB available). Use a smaller domain, another device, or --density-limit 0");
}

}  // namespace graupel::graph::density
