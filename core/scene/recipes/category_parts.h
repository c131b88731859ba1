// The parts of a recipe of categories (core/scene/recipes/category_recipe.h): what each kind of thing is drawn from.
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
    visit(&S::kinds, FieldInfo{"kinds", "", "Contacts to draw from; one named twice is drawn twice as often"});
    visit(&S::friction,
          FieldInfo{"friction", "", "Coulomb friction coefficient of the kind `friction`", Range::not_negative()});
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
    visit(&D::sizes, FieldInfo{"sizes", "m",
                               "Edge lengths of the domain to draw from; on a GPU scenes of one size advance together",
                               Range::positive()});
    visit(&D::dx, FieldInfo{"dx", "m", "Grid spacing", Range::positive()});
    visit(&D::wall_cells,
          FieldInfo{"wall_cells", "cells", "Distance of the walls from the domain's faces", Range::between(2, 16)});
    visit(&D::floor, FieldInfo{"floor", "", "Contact of the floor (y_low)"});
    visit(&D::walls, FieldInfo{"walls", "", "Contact of the other five walls"});
  }
};

/// A material as in a scene, some of whose constants are drawn.
struct RecipeMaterial : MaterialConfig {
  std::map<std::string, Interval> ranges;  ///< by the constant's key

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    MaterialConfig::fields(visit);
    visit(&RecipeMaterial::ranges,
          FieldInfo{"ranges", "",
                    "[low, high] of constants to draw, by key; uniform, from high/low = 10 on log-uniform"});
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
    visit(&B::count, FieldInfo{"count", "", "Bodies in a scene", Range::between(1, 1000)});
    visit(&B::size,
          FieldInfo{"size", "m", "Largest extent of a body; no extent of a box or cylinder is below the lower bound",
                    Range::positive()});
    visit(&B::shapes, FieldInfo{"shapes", "", "Shapes to draw from"}.offering("box sphere cylinder mesh"));
    visit(&B::meshes, FieldInfo{"meshes", "", "Files of the shape mesh, relative to the recipe"});
    visit(&B::materials,
          FieldInfo{"materials", "", "Materials in a scene, each with constants of its own", Range::between(1, 100)});
    visit(&B::speed, FieldInfo{"speed", "m/s", "Initial speed of thrown bodies and snow", Range::not_negative()});
    visit(&B::spin, FieldInfo{"spin", "rad/s", "Initial spin of thrown bodies and snow", Range::not_negative()});
    visit(&B::particles_per_cell,
          FieldInfo{"particles_per_cell", "", "Particles in a grid cell", {.low = 0, .high = 1000, .low_open = true}});
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
    visit(&O::count,
          FieldInfo{"count", "", "Obstacles of fall_on_obstacles; other categories draw some of them or none",
                    Range::between(0, 1000)});
    visit(&O::size, FieldInfo{"size", "m", "Largest extent; also of containers, paddles, boxes and trays that move",
                              Range::positive()});
    visit(&O::shapes, FieldInfo{"shapes", "", "Shapes to draw from"}.offering(
                          "box half_box sphere half_sphere cone pyramid cylinder mesh vdb"));
    visit(&O::meshes, FieldInfo{"meshes", "", "Files of the shape mesh, relative to the recipe"});
    visit(&O::level_sets, FieldInfo{"level_sets", "", "Files of the shape vdb, relative to the recipe"});
    visit(&O::surface, FieldInfo{"surface", "", "Contact of the obstacles, at rest and moving"});
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
    visit(&S::count, FieldInfo{"count", "", "Emitters of the category stream", Range::between(1, 100)});
    visit(&S::width, FieldInfo{"width", "m", "Diameter or edge of a stream", Range::positive()});
    visit(&S::speed, FieldInfo{"speed", "m/s", "Speed of new particles", Range::positive()});
    visit(&S::duration, FieldInfo{"duration", "s", "How long a stream flows; shorter where max_particles asks for it",
                                  Range::positive()});
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
    visit(&M::speed, FieldInfo{"speed", "m/s", "Speed of a sliding box", Range::positive()});
    visit(&M::spin, FieldInfo{"spin", "rad/s", "Rate of turn of a paddle", Range::positive()});
    visit(&M::tilt, FieldInfo{"tilt", "degrees", "Largest angle of a tray", {.low = 0, .high = 90, .low_open = true}});
    visit(&M::end,
          FieldInfo{"end", "", "When motions end, as a share of the run", {.low = 0, .high = 1, .low_open = true}});
  }
};

}  // namespace graupel
