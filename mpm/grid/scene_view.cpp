#include "mpm/grid/scene_view.h"

#include <fmt/format.h>

#include <cmath>

#include "core/system/error.h"

namespace graupel::mpm {

namespace {

constexpr double far_off = 1e30;  ///< [m]

Contact contact_of(Wall wall) {
  return wall == Wall::stick ? Contact::stick : wall == Wall::slip ? Contact::slip : Contact::separate;
}

/// A wall that holds the material, or a gate: then nothing holds it, and particles pass at the same plane.
template <typename T>
void set_wall(const Scene& scene, int axis, int side, WallView<T>& walls) {
  const Wall kind = scene.domain.wall(axis, side);
  const T away = static_cast<T>(side == 0 ? -far_off : far_off);
  walls.contact[axis][side] = contact_of(kind);
  walls.friction[axis][side] = static_cast<T>(scene.domain.friction(axis, side));
  T& face = (side == 0 ? walls.low : walls.high)[axis];
  T& gate = (side == 0 ? walls.gate_low : walls.gate_high)[axis];
  const bool is_gate = kind == Wall::open || kind == Wall::periodic;
  gate = is_gate ? face : away;
  if (side == 0) walls.periodic[axis] = {static_cast<int>(scene.domain.wall_cells), 0};
  if (!is_gate) return;
  walls.has_gates = true;
  face = away;
  (side == 0 ? walls.particle_low : walls.particle_high)[axis] = away;
  const double width = scene.wall_high()[axis] - scene.wall_low()[axis];
  if (kind != Wall::periodic) return;
  const double cells = width / scene.domain.dx;
  if (scene.domain.wall(axis, 1 - side) != kind || std::abs(cells - std::round(cells)) > 1e-6)
    throw ConfigError(fmt::format(
        "periodic walls need a partner at the other end of their axis and whole cells between them ({:.6g} cells along "
        "{}). Change the walls, the domain's size or dx",
        cells, "xyz"[axis]));
  walls.periodic[axis].cells = static_cast<int>(std::lround(cells));
}

/// Nothing is held along an axis that a run does not have.
template <typename T>
void remove_walls(int axis, WallView<T>& walls) {
  walls.low[axis] = walls.particle_low[axis] = walls.gate_low[axis] = static_cast<T>(-far_off);
  walls.high[axis] = walls.particle_high[axis] = walls.gate_high[axis] = static_cast<T>(far_off);
}

}  // namespace

/// Without push_out particles may creep past the walls, but never so far that their stencil leaves the grid.
template <typename T>
WallView<T> wall_view(const Scene& scene) {
  WallView<T> walls{};
  walls.low = scene.wall_low().cast<T>();
  walls.high = scene.wall_high().cast<T>();
  const Vec3d inset = Vec3d::filled((base_shift(scene.transfer.spline) + 0.1) * scene.domain.dx);
  walls.particle_low = scene.push_out ? walls.low : (scene.domain.origin + inset).cast<T>();
  walls.particle_high = scene.push_out ? walls.high : (scene.domain.origin + scene.domain.size - inset).cast<T>();
  for (int d = 0; d < scene.domain.axes(); ++d)
    for (int side = 0; side < 2; ++side) set_wall(scene, d, side, walls);
  if (scene.domain.is_plane()) remove_walls(2, walls);
  return walls;
}

template WallView<float> wall_view<float>(const Scene&);
template WallView<double> wall_view<double>(const Scene&);

}  // namespace graupel::mpm
