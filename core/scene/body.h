// Bodies: shapes in their own frame, with a pose. Sources, obstacles and emitters are bodies.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/math/mat.h"
#include "core/math/vec.h"
#include "core/scene/fields.h"
#include "core/scene/mesh.h"

namespace graupel {

/// Bodies, each in its own frame: centred at the origin unless said otherwise, y up.
enum class Shape {
  box,          ///< edges `size`
  half_box,     ///< a box of edges `size` cut at mid height: the lower half, -size.y/2 <= y <= 0
  sphere,       ///< `radius`
  half_sphere,  ///< the part y >= 0 of a sphere of `radius`
  cone,         ///< base radius `radius` at y = -height/2, tip at y = +height/2
  pyramid,      ///< square base of edges size.x, size.z at y = -height/2, tip at y = +height/2
  cylinder,     ///< `radius`, axis y, |y| <= height/2
  plane,        ///< the half-space y <= 0
  mesh,         ///< closed triangles of `file` (.obj .ply .stl), coordinates times `scale`
  vdb,          ///< level set of `file` (.vdb), coordinates times `scale`
  points        ///< particles only: positions of `file` (.txt/.xyz: x y z a line; .ply), times `scale`
};
template <>
struct EnumWords<Shape> {
  static constexpr std::pair<const char*, Shape> words[] = {
      {"box", Shape::box},           {"half_box", Shape::half_box},
      {"sphere", Shape::sphere},     {"half_sphere", Shape::half_sphere},
      {"cone", Shape::cone},         {"pyramid", Shape::pyramid},
      {"cylinder", Shape::cylinder}, {"plane", Shape::plane},
      {"mesh", Shape::mesh},         {"vdb", Shape::vdb},
      {"points", Shape::points}};
};

/// A body with its pose: x_world = R(rotation_axis, rotation_angle) x_local + position.
struct Body {
  Shape shape = Shape::box;
  Vec3d size = {0.1, 0.1, 0.1};  ///< [m]
  double radius = 0.05;          ///< [m]
  double height = 0.1;           ///< [m]
  std::string file;              ///< absolute after reading
  double scale = 1;
  Vec3d position = {0, 0, 0};       ///< [m]
  Vec3d rotation_axis = {0, 1, 0};  ///< any length but zero
  double rotation_angle = 0;        ///< [degrees]

  std::shared_ptr<const TriangleMesh> mesh;          ///< filled by the reader for Shape::mesh, already scaled
  std::shared_ptr<const std::vector<Vec3d>> points;  ///< filled by the reader for Shape::points, already scaled

  /// R(rotation_axis, rotation_angle).
  Mat3d rotation() const {
    return rotation_about(normalized(rotation_axis), rotation_angle * 3.14159265358979323846 / 180);
  }
  Vec3d to_local(const Vec3d& world) const { return transpose(rotation()) * (world - position); }
  Vec3d to_world(const Vec3d& local) const { return rotation() * local + position; }

  /// `shapes` are those that Self may have, space-separated.
  template <typename Self, typename Visitor>
  static void body_fields(Visitor&& visit, std::string_view shapes) {
    visit(&Self::shape, FieldInfo{"shape", "", "Kind of body"}.mandatory().offering(shapes));
    visit(&Self::size,
          FieldInfo{"size", "m", "Edge lengths (pyramid: x and z of the base)", Range::positive()}.mandatory().only_in(
              "box half_box pyramid"));
    visit(&Self::radius, FieldInfo{"radius", "m", "Radius (cone: of the base)", Range::positive()}.mandatory().only_in(
                             "sphere half_sphere cone cylinder"));
    visit(&Self::height,
          FieldInfo{"height", "m", "Height along the body's y axis", Range::positive()}.mandatory().only_in(
              "cone pyramid cylinder"));
    visit(&Self::file, FieldInfo{"file", "", "File with the geometry, relative to the scene file"}.mandatory().only_in(
                           "mesh vdb points"));
    visit(&Self::scale,
          FieldInfo{"scale", "", "Factor on the file's coordinates", Range::positive()}.only_in("mesh vdb points"));
    visit(&Self::position, FieldInfo{"position", "m", "Where the body's own origin lies in the world"});
    visit(&Self::rotation_axis, FieldInfo{"rotation_axis", "", "Axis of the rotation, through the body's own origin"});
    visit(&Self::rotation_angle, FieldInfo{"rotation_angle", "degrees", "Angle of the rotation"});
  }
};

/// How particles are placed in a source.
enum class Sampling {
  random,           ///< Taichi Elements' rule: int(n V/dx^3 + 1) (box) or ceil(n V/dx^3) (others) uniform random points
  jittered_lattice  ///< a lattice of n points a cell, each moved at random inside its sub-cell
};
template <>
struct EnumWords<Sampling> {
  static constexpr std::pair<const char*, Sampling> words[] = {{"random", Sampling::random},
                                                               {"jittered_lattice", Sampling::jittered_lattice}};
};

}  // namespace graupel
