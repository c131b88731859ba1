// The parts of a recipe of categories (core/scene/category_recipe.h): what each kind of thing is drawn from.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/scene/interval.h"
#include "core/scene/scene.h"

namespace graupel {

/// Contact of a wall or an obstacle, from free to sticky.
enum class SurfaceKind {
  slip,      ///< Contact::slip without friction
  separate,  ///< Contact::separate without friction
  friction,  ///< Contact::separate with a drawn coefficient
  stick      ///< Contact::stick
};
template <>
struct EnumWords<SurfaceKind> {
  static constexpr std::pair<const char*, SurfaceKind> words[] = {{"slip", SurfaceKind::slip},
                                                                  {"separate", SurfaceKind::separate},
                                                                  {"friction", SurfaceKind::friction},
                                                                  {"stick", SurfaceKind::stick}};
};

struct RecipeSurface {
  std::vector<SurfaceKind> kinds = {SurfaceKind::slip, SurfaceKind::separate, SurfaceKind::friction,
                                    SurfaceKind::friction, SurfaceKind::stick};
  Interval friction = {0.1, 0.7};

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = RecipeSurface;
    visit(&S::kinds, FieldInfo{.name = "kinds",
                               .unit = "",
                               .meaning = "Contacts to draw from; one named twice is drawn twice as often"});
    visit(&S::friction, FieldInfo{.name = "friction",
                                  .unit = "",
                                  .meaning = "Coulomb friction coefficient of the kind `friction`",
                                  .range = Range::not_negative()});
  }
};

struct RecipeDomain {
  std::vector<Vec3d> sizes = {{1, 1, 1}};
  double dx = 1.0 / 64;
  int64_t wall_cells = 3;
  RecipeSurface floor, walls;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using D = RecipeDomain;
    visit(&D::sizes,
          FieldInfo{.name = "sizes",
                    .unit = "m",
                    .meaning = "Edge lengths of the domain to draw from; on a GPU scenes of one size advance together",
                    .range = Range::positive()});
    visit(&D::dx, FieldInfo{.name = "dx", .unit = "m", .meaning = "Grid spacing", .range = Range::positive()});
    visit(&D::wall_cells, FieldInfo{.name = "wall_cells",
                                    .unit = "cells",
                                    .meaning = "Distance of the walls from the domain's faces",
                                    .range = Range::between(2, 16)});
    visit(&D::floor, FieldInfo{.name = "floor", .unit = "", .meaning = "Contact of the floor (y_low)"});
    visit(&D::walls, FieldInfo{.name = "walls", .unit = "", .meaning = "Contact of the other five walls"});
  }
};

/// A material as in a scene, some of whose constants are drawn.
struct RecipeMaterial : MaterialConfig {
  std::map<std::string, Interval> ranges;  ///< by the constant's key

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    MaterialConfig::fields(visit);
    visit(&RecipeMaterial::ranges,
          FieldInfo{.name = "ranges",
                    .unit = "",
                    .meaning = "[low, high] of constants to draw, by key; uniform, from high/low = 10 on log-uniform"});
  }
};

/// A geometry file that a recipe names, found and read.
struct RecipeGeometry {
  std::string file;                          ///< absolute
  std::shared_ptr<const TriangleMesh> mesh;  ///< at scale 1; empty for a level set
};

struct RecipeBodies {
  WholeInterval count = {1, 8};
  Interval size = {0.04, 0.4};
  std::vector<Shape> shapes = {Shape::box, Shape::sphere, Shape::cylinder};
  std::vector<std::string> meshes;
  WholeInterval materials = {1, 3};
  Interval speed = {0.5, 4};
  Interval spin = {0, 12};
  double particles_per_cell = 8;

  std::vector<RecipeGeometry> geometry;  ///< of `meshes`, filled by the reader

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using B = RecipeBodies;
    visit(&B::count,
          FieldInfo{.name = "count", .unit = "", .meaning = "Bodies in a scene", .range = Range::between(1, 1000)});
    visit(&B::size,
          FieldInfo{.name = "size",
                    .unit = "m",
                    .meaning = "Largest extent of a body; no extent of a box or cylinder is below the lower bound",
                    .range = Range::positive()});
    visit(&B::shapes,
          FieldInfo{.name = "shapes", .unit = "", .meaning = "Shapes to draw from: box, sphere, cylinder, mesh"});
    visit(&B::meshes,
          FieldInfo{.name = "meshes", .unit = "", .meaning = "Files of the shape mesh, relative to the recipe"});
    visit(&B::materials, FieldInfo{.name = "materials",
                                   .unit = "",
                                   .meaning = "Materials in a scene, each with constants of its own",
                                   .range = Range::between(1, 100)});
    visit(&B::speed, FieldInfo{.name = "speed",
                               .unit = "m/s",
                               .meaning = "Initial speed of thrown bodies and snow",
                               .range = Range::not_negative()});
    visit(&B::spin, FieldInfo{.name = "spin",
                              .unit = "rad/s",
                              .meaning = "Initial spin of thrown bodies and snow",
                              .range = Range::not_negative()});
    visit(&B::particles_per_cell, FieldInfo{.name = "particles_per_cell",
                                            .unit = "",
                                            .meaning = "Particles in a grid cell",
                                            .range = {.low = 0, .high = 1000, .low_open = true}});
  }
};

struct RecipeFixedObstacles {
  WholeInterval count = {1, 5};
  Interval size = {0.1, 0.4};
  std::vector<Shape> shapes = {Shape::box,  Shape::half_box, Shape::sphere,  Shape::half_sphere,
                               Shape::cone, Shape::pyramid,  Shape::cylinder};
  std::vector<std::string> meshes, level_sets;
  RecipeSurface surface;

  std::vector<RecipeGeometry> mesh_geometry, level_set_geometry;  ///< filled by the reader

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using O = RecipeFixedObstacles;
    visit(&O::count, FieldInfo{.name = "count",
                               .unit = "",
                               .meaning = "Obstacles of fall_on_obstacles; other categories draw some of them or none",
                               .range = Range::between(0, 1000)});
    visit(&O::size, FieldInfo{.name = "size",
                              .unit = "m",
                              .meaning = "Largest extent; also of containers, paddles, boxes and trays that move",
                              .range = Range::positive()});
    visit(&O::shapes,
          FieldInfo{
              .name = "shapes", .unit = "", .meaning = "Shapes to draw from: all of a scene's obstacles but plane"});
    visit(&O::meshes,
          FieldInfo{.name = "meshes", .unit = "", .meaning = "Files of the shape mesh, relative to the recipe"});
    visit(&O::level_sets,
          FieldInfo{.name = "level_sets", .unit = "", .meaning = "Files of the shape vdb, relative to the recipe"});
    visit(&O::surface,
          FieldInfo{.name = "surface", .unit = "", .meaning = "Contact of the obstacles, at rest and moving"});
  }
};

struct RecipeStreams {
  WholeInterval count = {1, 2};
  Interval width = {0.05, 0.12};
  Interval speed = {0.5, 2.5};
  Interval duration = {0.5, 2};

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = RecipeStreams;
    visit(&S::count, FieldInfo{.name = "count",
                               .unit = "",
                               .meaning = "Emitters of the category stream",
                               .range = Range::between(1, 100)});
    visit(
        &S::width,
        FieldInfo{.name = "width", .unit = "m", .meaning = "Diameter or edge of a stream", .range = Range::positive()});
    visit(&S::speed,
          FieldInfo{.name = "speed", .unit = "m/s", .meaning = "Speed of new particles", .range = Range::positive()});
    visit(&S::duration, FieldInfo{.name = "duration",
                                  .unit = "s",
                                  .meaning = "How long a stream flows; shorter where max_particles asks for it",
                                  .range = Range::positive()});
  }
};

struct RecipeMotions {
  Interval speed = {0.1, 0.8};
  Interval spin = {1, 5};
  Interval tilt = {10, 35};
  Interval end = {0.4, 0.7};

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using M = RecipeMotions;
    visit(&M::speed,
          FieldInfo{.name = "speed", .unit = "m/s", .meaning = "Speed of a sliding box", .range = Range::positive()});
    visit(
        &M::spin,
        FieldInfo{.name = "spin", .unit = "rad/s", .meaning = "Rate of turn of a paddle", .range = Range::positive()});
    visit(&M::tilt, FieldInfo{.name = "tilt",
                              .unit = "degrees",
                              .meaning = "Largest angle of a tray",
                              .range = {.low = 0, .high = 90, .low_open = true}});
    visit(&M::end, FieldInfo{.name = "end",
                             .unit = "",
                             .meaning = "When motions end, as a share of the run",
                             .range = {.low = 0, .high = 1, .low_open = true}});
  }
};

}  // namespace graupel
