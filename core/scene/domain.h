// The domain of a scene: its box, its grid, and what each of its six walls does.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/math/vec.h"
#include "core/scene/fields.h"

namespace graupel {

/// What a wall or an obstacle does to the velocity of the material that touches it.
enum class Contact {
  stick,    ///< the material takes the obstacle's velocity
  slip,     ///< no normal velocity either way, Coulomb friction along the surface
  separate  ///< no velocity into the surface, free to leave, Coulomb friction along it
};
template <>
struct EnumWords<Contact> {
  static constexpr std::pair<const char*, Contact> words[] = {
      {"stick", Contact::stick}, {"slip", Contact::slip}, {"separate", Contact::separate}};
};

/// What one of the six walls does.
enum class Wall {
  stick,     ///< as Contact
  slip,      ///< as Contact
  separate,  ///< as Contact
  open,      ///< particles that cross it leave the run
  periodic   ///< particles that cross it come in at the opposite wall, which must be periodic too
};
template <>
struct EnumWords<Wall> {
  static constexpr std::pair<const char*, Wall> words[] = {{"stick", Wall::stick},
                                                           {"slip", Wall::slip},
                                                           {"separate", Wall::separate},
                                                           {"open", Wall::open},
                                                           {"periodic", Wall::periodic}};
};
inline Wall wall_of(Contact contact) {
  return contact == Contact::stick ? Wall::stick : contact == Contact::slip ? Wall::slip : Wall::separate;
}

struct WallConfig {
  Wall kind = Wall::separate;
  std::optional<double> friction;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using W = WallConfig;
    visit(&W::kind, FieldInfo{"kind", "", "What the wall does"}.mandatory());
    visit(
        &W::friction,
        FieldInfo{"friction", "", "Coulomb friction coefficient; default wall_friction", Range::not_negative()}.only_in(
            "slip separate"));
  }
};

/// Walls that differ from the others.
struct Faces {
  std::optional<WallConfig> x_low, x_high, y_low, y_high, z_low, z_high;

  /// Side 0 is the lower one.
  const std::optional<WallConfig>& at(int axis, int side) const {
    const std::optional<WallConfig>* all[] = {&x_low, &x_high, &y_low, &y_high, &z_low, &z_high};
    return *all[2 * axis + side];
  }
  std::optional<WallConfig>& at(int axis, int side) {
    return const_cast<std::optional<WallConfig>&>(std::as_const(*this).at(axis, side));
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using F = Faces;
    visit(&F::x_low, FieldInfo{"x_low", "", "Wall at the lower end of x"});
    visit(&F::x_high, FieldInfo{"x_high", "", "Wall at the upper end of x"});
    visit(&F::y_low, FieldInfo{"y_low", "", "Wall at the lower end of y: the floor"});
    visit(&F::y_high, FieldInfo{"y_high", "", "Wall at the upper end of y"});
    visit(&F::z_low, FieldInfo{"z_low", "", "Wall at the lower end of z"});
    visit(&F::z_high, FieldInfo{"z_high", "", "Wall at the upper end of z"});
  }
};

/// Axis-aligned domain with walls. With two dimensions it is a plane of constant z, half way between the domain's
/// faces, in plane strain: nothing moves along z or depends on it, and its walls do nothing. Masses, volumes, forces
/// and energies are then those of 1 m of depth.
struct Domain {
  int64_t dimensions = 3;    ///< 2 or 3
  Vec3d origin = {0, 0, 0};  ///< lower corner [m]
  Vec3d size = {1, 1, 1};    ///< [m]
  double dx = 1.0 / 64;      ///< [m]
  Contact walls = Contact::separate;
  double wall_friction = 0;
  Faces faces;
  int64_t wall_cells = 3;  ///< cells between the domain's faces and the walls that hold the material

  /// What the wall of an axis does; side 0 is the lower one.
  Wall wall(int axis, int side) const {
    const auto& own = faces.at(axis, side);
    return own ? own->kind : wall_of(walls);
  }
  double friction(int axis, int side) const {
    const auto& own = faces.at(axis, side);
    return own ? own->friction.value_or(wall_friction) : wall_friction;
  }
  bool has_wall(Wall kind) const {
    for (int face = 0; face < 2 * axes(); ++face)
      if (wall(face / 2, face % 2) == kind) return true;
    return false;
  }
  bool is_plane() const { return dimensions == 2; }
  /// Axes with nodes: x and y, or all.
  int axes() const { return static_cast<int>(dimensions); }
  /// The z of a plane run [m].
  double plane() const { return origin[2] + size[2] / 2; }
  /// Of a grid cell [m^3].
  double cell_volume() const { return is_plane() ? dx * dx : dx * dx * dx; }
  /// Of particles on a lattice with this many in a cell [m].
  double spacing(double particles_per_cell) const {
    return dx / (is_plane() ? std::sqrt(particles_per_cell) : std::cbrt(particles_per_cell));
  }
  /// Lower and upper corner of the box that holds the material [m]; the whole domain along z in the plane.
  Vec3d wall_low() const { return origin + wall_distance(); }
  Vec3d wall_high() const { return origin + size - wall_distance(); }
  Vec3d wall_distance() const {
    const double distance = static_cast<double>(wall_cells) * dx;
    return {distance, distance, is_plane() ? 0 : distance};
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using D = Domain;
    visit(&D::dimensions, FieldInfo{"dimensions", "", "3: space; 2: the plane half way along z, in plane strain",
                                    Range::between(2, 3)});
    visit(&D::origin, FieldInfo{"origin", "m", "Lower corner of the domain"});
    visit(&D::size, FieldInfo{"size", "m", "Edge lengths of the domain", Range::positive()});
    visit(&D::dx, FieldInfo{"dx", "m", "Grid spacing", Range::positive()});
    visit(&D::walls, FieldInfo{"walls", "", "Contact at the walls"});
    visit(&D::wall_friction,
          FieldInfo{"wall_friction", "", "Coulomb friction coefficient of the walls", Range::not_negative()});
    visit(&D::faces, FieldInfo{"faces", "", "Walls that differ from `walls`, by side"});
    visit(&D::wall_cells,
          FieldInfo{"wall_cells", "cells", "Distance of the walls from the domain's faces; material stays inside them",
                    Range::between(2, 16)});
  }
};

}  // namespace graupel
