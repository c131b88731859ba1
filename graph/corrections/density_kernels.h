// Kernels of the density projection (graph/corrections/density_projection.cpp), for host and device.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/math/vec.h"
#include "core/parallel/host_device.h"
#include "graph/topology/grid_kernels.h"
#include "sparsegrid/obstacle.h"

namespace graupel::graph::density {

using grid::add_to;
using grid::corners;
using grid::lowest_one;
using grid::set_bit;
using grid::word_bits;

inline constexpr uint32_t full = 1u << 22;  ///< mass of a cell of the largest density
inline constexpr int place_bits = 10;       ///< of a particle's place in its cell, so that weights are integers
inline constexpr float narrowest = 0.05f;   ///< least open fraction of a cell that may be called free
inline constexpr float most_way = 0.5f;     ///< [cells] along an axis
inline constexpr float closed = 1e-3f;      ///< a cell with less open faces has no pressure

/// Fractions of a cell and of its faces to the lower neighbours that walls and obstacles leave free.
struct OpenFractions {
  float cell, face[3];
};

/// Dense cells. size[0] is even, so that cells 2 k and 2 k + 1 have different colours: bit k of a colour is one of
/// them.
struct Cells {
  Vec3d origin;  ///< [m] lower corner of cell (0, 0, 0)
  double spacing, inverse_spacing;
  Vec3i size;

  GRAUPEL_HD int64_t count() const { return int64_t{size[0]} * size[1] * size[2]; }
  GRAUPEL_HD int32_t stride(int axis) const { return axis == 0 ? 1 : axis == 1 ? size[0] : size[0] * size[1]; }
  GRAUPEL_HD int32_t number(const Vec3i& c) const { return (c[2] * size[1] + c[1]) * size[0] + c[0]; }
  GRAUPEL_HD int32_t corner(int32_t base, int k) const {
    return base + (k & 1) * stride(0) + (k >> 1 & 1) * stride(1) + (k >> 2 & 1) * stride(2);
  }
  /// The lowest of the eight cells around x, and where x lies between their centres, 0 to 1. False for particles whose
  /// cells are at the grid's border or beyond it.
  GRAUPEL_HD bool locate(const Vec3f& x, Vec3i& cell, Vec3d& at) const {
    for (int d = 0; d < 3; ++d) {
      const double u = (static_cast<double>(x[d]) - origin[d]) * inverse_spacing - 0.5, floored = std::floor(u);
      if (!(floored >= 1 && floored + 2 < size[d])) return false;  // NaN too
      cell[d] = static_cast<int>(floored);
      at[d] = u - floored;
    }
    return true;
  }
  /// Bits of a colour's words.
  GRAUPEL_HD int64_t words_of_color() const { return (count() / 2 + word_bits - 1) / word_bits; }
  GRAUPEL_HD int64_t bit_of(const Vec3i& c) const {
    return ((c[0] + c[1] + c[2]) & 1) * words_of_color() * word_bits + number(c) / 2;
  }
  GRAUPEL_HD int32_t cell_of_bit(int color, int64_t bit) const {
    const auto even = static_cast<int32_t>(2 * bit), row = even / size[0];
    return even + ((row % size[1] + row / size[1] + color) & 1);
  }
};

/// Fraction of a tent of half width 1 that lies on the free side, s from its centre to the wall.
GRAUPEL_HD inline float open_cell_fraction(double s) {
  if (s <= -1) return 0;
  if (s >= 1) return 1;
  return static_cast<float>(s < 0 ? (1 + s) * (1 + s) / 2 : 1 - (1 - s) * (1 - s) / 2);
}

/// Fraction of a face across `axis` that lies before a plane: the face's extent along the plane's normal is what it
/// takes from closed to open. A face in the plane itself is closed.
GRAUPEL_HD inline float open_face_fraction(const sparsegrid::SignedDistance<double>& plane, int axis) {
  constexpr double thickness = 1e-3;
  double extent = 0;
  for (int d = 0; d < 3; ++d)
    if (d != axis) extent += std::abs(plane.normal[d]);
  const double free = 0.5 + (plane.phi - thickness) / (extent > 2 * thickness ? extent : 2 * thickness);
  return static_cast<float>(free < 0 ? 0 : free > 1 ? 1 : free);
}

/// Whether a thin obstacle parts two neighbouring cell centres: seen from both, its surface lies on the way.
GRAUPEL_HD inline bool stands_between(const sparsegrid::SignedDistance<double>& below,
                                      const sparsegrid::SignedDistance<double>& above, int axis) {
  const double down = -below.normal[axis], up = above.normal[axis];
  return down > 0 && up > 0 && below.phi / down + above.phi / up <= 1;
}

struct FindOpenFractions {
  Cells cells;
  sparsegrid::ObstacleSetView obstacles;
  Vec3d low, high;  ///< [m] the walls
  OpenFractions* open_fractions;

  /// Distance phi [cells] and normal of the nearest wall or obstacle; beyond an obstacle's band it is far, on both
  /// sides.
  GRAUPEL_HD sparsegrid::SignedDistance<double> nearest(const Vec3d& x) const {
    int index = -1;
    auto solid = sparsegrid::signed_distance(obstacles, x, index);
    const double far = 2 * cells.spacing;
    if (index < 0)
      solid = {far, Vec3d::zero()};
    else if (solid.phi <= -obstacles.obstacles[index].exact.band)
      solid = {-far, Vec3d::zero()};
    for (int side = 0; side < 6; ++side) {
      const int d = side / 2, sign = side % 2 == 0 ? 1 : -1;
      const double phi = sign * (x[d] - (sign > 0 ? low[d] : high[d]));
      if (phi >= solid.phi) continue;
      solid = {phi, Vec3d::zero()};
      solid.normal[d] = sign;
    }
    solid.phi *= cells.inverse_spacing;
    return solid;
  }
  /// Whether no surface comes near the faces of a cell: distances change by at most steepest_grid times the way, and a
  /// cell beyond the band of all obstacles is at least a band away from them.
  GRAUPEL_HD bool is_far_from_surfaces(const sparsegrid::SignedDistance<double>& centre) const {
    return std::abs(centre.phi) >= 1.9 &&
           (obstacles.count == 0 || obstacles.obstacles[0].exact.band >= 1.3 * cells.spacing);
  }
  /// Of the lower faces of the cell around `centre`, whose nearest surface is `here`.
  GRAUPEL_HD void find_faces(const Vec3d& centre, const sparsegrid::SignedDistance<double>& here,
                             float* fractions) const {
    for (int d = 0; d < 3; ++d) {
      Vec3d face = centre;
      face[d] -= cells.spacing / 2;
      Vec3d neighbor = centre;
      neighbor[d] -= cells.spacing;
      fractions[d] = stands_between(nearest(neighbor), here, d) ? 0 : open_face_fraction(nearest(face), d);
    }
  }
  GRAUPEL_HD void operator()(int64_t i) const {
    const auto n = static_cast<int32_t>(i);
    const Vec3i cell = {n % cells.size[0], n / cells.size[0] % cells.size[1], n / cells.size[0] / cells.size[1]};
    const Vec3d centre = cells.origin + (cell.cast<double>() + Vec3d::filled(0.5)) * cells.spacing;
    OpenFractions& open_fraction = open_fractions[i];
    const auto here = nearest(centre);
    open_fraction.cell = open_cell_fraction(here.phi);
    if (is_far_from_surfaces(here))
      for (float& face : open_fraction.face) face = here.phi > 0 ? 1 : 0;
    else
      find_faces(centre, here, open_fraction.face);
  }
};

/// A grid without matter and pressure. Item i: cell i and entry i of the lists.
struct StartCells {
  FindOpenFractions find;
  int64_t words;  ///< of both colours
  uint32_t *mass, *word;
  float* pressure;
  int32_t* rank;  ///< [words + 1]
  GRAUPEL_HD int64_t items() const { return find.cells.count() > words ? find.cells.count() : words + 1; }
  GRAUPEL_HD void operator()(int64_t i) const {
    if (i < find.cells.count()) {
      find(i);
      mass[i] = 0;
      pressure[i] = 0;
    }
    if (i < words) word[i] = 0;
    if (i <= words) rank[i] = 0;
  }
};

/// Spreads a particle's mass; marks the cells that get some.
struct Spread {
  Cells cells;
  const Vec3f* position;
  uint64_t unit;  ///< mass of a particle
  uint32_t *mass, *words;
  bool alone;           ///< one thread spreads all
  const int32_t* skip;  ///< where it is not 0 nothing is done; null: none
  GRAUPEL_HD void operator()(int64_t p) const {
    if (skip != nullptr && *skip != 0) return;
    Vec3i cell;
    Vec3d at;
    if (!cells.locate(position[p], cell, at)) return;
    constexpr uint64_t one = 1u << place_bits;
    uint64_t weight[3][2];
    for (int d = 0; d < 3; ++d) {
      weight[d][1] = static_cast<uint64_t>(std::floor(at[d] * static_cast<double>(one) + 0.5));
      weight[d][0] = one - weight[d][1];
    }
    const int32_t base = cells.number(cell);
    for (int k = 0; k < corners; ++k) {
      // Downwards, so that the rounding of matter at rest is no excess.
      const auto contribution = static_cast<uint32_t>(
          (unit * (weight[0][k & 1] * weight[1][k >> 1 & 1]) * weight[2][k >> 2 & 1]) >> 3 * place_bits);
      if (contribution == 0) continue;
      if (add(mass[cells.corner(base, k)], contribution) == 0) set_bit(words, cells.bit_of(grid::corner_of(cell, k)));
    }
  }
  GRAUPEL_HD uint32_t add(uint32_t& sum, uint32_t value) const {
    if (!alone) return add_to(sum, value);
    const uint32_t before = sum;
    sum += value;
    return before;
  }
};

/// The cells of both colours that hold matter, one colour after the other. rank[w]: bits in the words before word w.
struct ActiveCells {
  Cells cells;
  const int32_t* rank;
  int32_t* cell;
  GRAUPEL_HD int32_t begin(int color) const { return rank[color * cells.words_of_color()]; }
  GRAUPEL_HD int32_t size(int color) const { return begin(color + 1) - begin(color); }
};

/// The pressure of a cell without matter is 0.
struct DropPressure {
  ActiveCells last;
  const uint32_t* mass;
  float* pressure;
  GRAUPEL_HD void operator()(int64_t k) const {
    if (k < last.begin(2) && mass[last.cell[k]] == 0) pressure[last.cell[k]] = 0;
  }
};

/// What a cell's pressure is solved from.
struct Equation {
  float excess, inverse_sum;  ///< of the open faces; 0 for a closed cell
};

/// Of a cell with this mass, its open fractions and those of its upper faces.
GRAUPEL_HD inline Equation equation_of(uint32_t mass, const OpenFractions& own, const float (&upper)[3]) {
  float open = 0;
  for (int d = 0; d < 3; ++d) open += own.face[d] + upper[d];
  const float room = own.cell > narrowest ? own.cell : narrowest;
  return {static_cast<float>(mass) / full - room, open < closed ? 0 : 1 / open};
}

/// The next pressure of a cell from its last one and from what its neighbours and its excess sum to.
GRAUPEL_HD inline float relaxed(float before, float sum, float inverse_sum, float relaxation) {
  const float p = before + relaxation * (sum * inverse_sum - before);
  return p > 0 ? p : 0;
}

/// Lists the cells of a word, with their equations, and clears the word and their mass.
struct ListCells {
  ActiveCells active;
  const OpenFractions* open_fractions;
  uint32_t *words, *mass;
  Equation* equation;
  GRAUPEL_HD void operator()(int64_t w) const {
    const int64_t in_color = active.cells.words_of_color();
    const int color = w >= in_color;
    int32_t number = active.rank[w];
    for (uint32_t left = words[w]; left != 0; left &= left - 1, ++number) {
      const int32_t i = active.cells.cell_of_bit(color, (w - color * in_color) * word_bits + lowest_one(left));
      active.cell[number] = i;
      equation[number] = equation_of(i);
      mass[i] = 0;
    }
    words[w] = 0;
  }
  GRAUPEL_HD Equation equation_of(int32_t i) const {
    float upper[3];
    for (int d = 0; d < 3; ++d) upper[d] = open_fractions[i + active.cells.stride(d)].face[d];
    return density::equation_of(mass[i], open_fractions[i], upper);
  }
};

/// One colour's pressures from those of the other.
struct Sweep {
  ActiveCells active;
  int color;
  float relaxation;
  const OpenFractions* open_fractions;
  const Equation* equation;
  float* pressure;
  GRAUPEL_HD void operator()(int64_t n) const {
    const int64_t k = active.begin(color) + n;
    if (k >= active.begin(color + 1)) return;
    const Equation e = equation[k];
    if (e.inverse_sum == 0) return;
    const int32_t i = active.cell[k];
    const OpenFractions own = open_fractions[i];
    float sum = e.excess;
    for (int d = 0; d < 3; ++d) {
      const int32_t s = active.cells.stride(d);
      sum += own.face[d] * pressure[i - s] + open_fractions[i + s].face[d] * pressure[i + s];
    }
    pressure[i] = relaxed(pressure[i], sum, e.inverse_sum, relaxation);
  }
};

/// Moves a particle by the displacements of the faces around it.
struct MoveParticle {
  Cells cells;
  const OpenFractions* open_fractions;
  const float* pressure;
  Vec3f* position;
  const int32_t* skip;  ///< as Spread has it
  GRAUPEL_HD void operator()(int64_t p) const {
    if (skip != nullptr && *skip != 0) return;
    Vec3i cell;
    Vec3d at;
    if (!cells.locate(position[p], cell, at)) return;
    Vec3f way;
    for (int axis = 0; axis < 3; ++axis) {
      const float u = displacement(axis, cell, at.cast<float>());
      way[axis] = u < -most_way ? -most_way : u > most_way ? most_way : u;
    }
    position[p] += way * static_cast<float>(cells.spacing);
  }
  /// Along an axis [cells]; the lower face of cell c lies half a cell below its centre.
  GRAUPEL_HD float displacement(int axis, const Vec3i& cell, Vec3f at) const {
    int32_t base = cells.number(cell);
    const int32_t s = cells.stride(axis);
    at[axis] += 0.5f;
    if (at[axis] >= 1) {
      at[axis] -= 1;
      base += s;
    }
    float u = 0;
    for (int k = 0; k < corners; ++k) {
      const int32_t c = cells.corner(base, k);
      float weight = open_fractions[c].face[axis];
      for (int d = 0; d < 3; ++d) weight *= k >> d & 1 ? at[d] : 1 - at[d];
      u += weight * (pressure[c - s] - pressure[c]);
    }
    return u;
  }
};

/// Moves a particle on one grid and spreads it on the next.
struct MoveAndSpread {
  MoveParticle move;
  Spread spread;
  GRAUPEL_HD void operator()(int64_t p) const {
    move(p);
    spread(p);
  }
};

}  // namespace graupel::graph::density
