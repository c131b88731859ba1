// Where matter is, for groups of what flies: fine cells as bits of cells, 64 a cell, for host and device.
#pragma once

#include <cstdint>

#include "core/math/vec.h"
#include "core/parallel/host_device.h"

namespace graupel::graph::flight {

/// Fine cells a cell along an axis. Fine cells at most so many apart along each axis are near: then all of a cell are,
/// and none but those of the 26 neighbours can be.
inline constexpr int fine_cells = 4;

struct FineCell {
  int32_t cell;
  uint64_t bit;  ///< x + 4 y + 16 z of it
};

/// Dense cells; what lies beyond counts in the outermost fine ones.
struct FlightCells {
  Vec3f origin;              ///< [m]
  float fine, inverse_fine;  ///< [m], [1/m]
  Vec3i size;                ///< [cells]
  GRAUPEL_HD int64_t count() const { return int64_t{size[0]} * size[1] * size[2]; }

  GRAUPEL_HD FineCell of(const Vec3f& x) const {
    int32_t cell = 0, place = 0;
    for (int d = 2; d >= 0; --d) {
      const float u = (x[d] - origin[d]) * inverse_fine, last = static_cast<float>(fine_cells * size[d] - 1);
      const auto at = static_cast<int32_t>(u > 0 ? (u < last ? u : last) : 0);  // NaN: 0
      cell = cell * size[d] + at / fine_cells;
      place = place * fine_cells + at % fine_cells;
    }
    return {cell, uint64_t{1} << place};
  }
  GRAUPEL_HD Vec3i at(int32_t cell) const {
    return {cell % size[0], cell / size[0] % size[1], cell / size[0] / size[1]};
  }
  /// The cell at `step` from the one at `from`; -1 outside.
  GRAUPEL_HD int32_t beside(const Vec3i& from, const Vec3i& step) const {
    int32_t cell = 0;
    for (int d = 2; d >= 0; --d) {
      const int to = from[d] + step[d];
      if (to < 0 || to >= size[d]) return -1;
      cell = cell * size[d] + to;
    }
    return cell;
  }
  GRAUPEL_HD Vec3f centre(int32_t cell) const {
    const Vec3i place = at(cell);
    Vec3f x;
    for (int d = 0; d < 3; ++d) x[d] = origin[d] + (static_cast<float>(place[d]) + 0.5f) * (fine_cells * fine);
    return x;
  }
};

/// The fine cells of a neighbour at `step` (-1, 0, 1) along an axis that are near to one of `bits`: those up to it from
/// the side that faces it, or from both.
GRAUPEL_HD inline uint64_t near_along(uint64_t bits, int axis, int step) {
  const uint64_t first = axis == 0 ? 0x1111111111111111u : axis == 1 ? 0x000f000f000f000fu : 0xffffu;  // place 0
  const int one = 1 << (2 * axis), two = 2 * one;
  const uint64_t first_two = first | first << one;
  uint64_t down = bits, up = bits;
  down |= down >> one & ~(first << (3 * one));
  down |= down >> two & first_two;
  up |= up << one & ~first;
  up |= up << two & ~first_two;
  return step > 0 ? down : step < 0 ? up : down | up;
}

/// Whether a fine cell of `bits` is near to one of the `others` in the neighbour at `step`.
GRAUPEL_HD inline bool any_near(uint64_t bits, uint64_t others, const Vec3i& step) {
  if (bits == 0 || others == 0) return false;
  for (int d = 0; d < 3; ++d) bits = near_along(bits, d, step[d]);
  return (bits & others) != 0;
}

}  // namespace graupel::graph::flight
