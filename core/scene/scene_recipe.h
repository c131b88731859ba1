// A recipe: the random distribution of scenes that a data set is drawn from (HGN paper, section 3.3).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace graupel {

/// Scenes of a data set, by split. Split and index select the random numbers, so the splits never share a scene.
struct RecipeCounts {
  int64_t train = 800, valid = 5, test = 20;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = RecipeCounts;
    visit(&C::train,
          FieldInfo{.name = "train", .unit = "", .meaning = "Training scenes", .range = Range::between(0, 1e6)});
    visit(&C::valid,
          FieldInfo{.name = "valid", .unit = "", .meaning = "Validation scenes", .range = Range::between(0, 1e6)});
    visit(&C::test, FieldInfo{.name = "test", .unit = "", .meaning = "Test scenes", .range = Range::between(0, 1e6)});
  }
};

/// Groups of particles: balls and cubes of one size and of a random material each, or cut in two halves of two.
struct RecipeGroups {
  int64_t count = 4;
  std::vector<std::string> shapes = {"sphere", "box"};
  std::vector<std::string> materials;
  double size = 0.08;
  double max_speed = 0;
  double mixed_share = 0;
  double particles_per_cell = 8;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using G = RecipeGroups;
    visit(&G::count, FieldInfo{.name = "count",
                               .unit = "",
                               .meaning = "Groups of particles in a scene",
                               .range = Range::between(1, 10000)});
    visit(&G::shapes, FieldInfo{.name = "shapes", .unit = "", .meaning = "Shapes to draw from: sphere, box"});
    visit(
        &G::materials,
        FieldInfo{.name = "materials", .unit = "", .meaning = "Materials to draw from; default: all of the recipe's"});
    visit(
        &G::size,
        FieldInfo{
            .name = "size", .unit = "m", .meaning = "Edge of a box, diameter of a sphere", .range = Range::positive()});
    visit(&G::max_speed, FieldInfo{.name = "max_speed",
                                   .unit = "m/s",
                                   .meaning = "Initial velocity: uniform direction, speed uniform up to this",
                                   .range = Range::not_negative()});
    visit(&G::mixed_share,
          FieldInfo{.name = "mixed_share",
                    .unit = "",
                    .meaning = "Share of the groups that are cut along a random axis in halves of two materials",
                    .range = Range::between(0, 1)});
    visit(&G::particles_per_cell, FieldInfo{.name = "particles_per_cell",
                                            .unit = "",
                                            .meaning = "Particles in a grid cell",
                                            .range = Range::positive()});
  }
};

/// Obstacles: bodies of random kind, size, position and orientation that do not overlap.
struct RecipeObstacles {
  int64_t count = 5;
  std::vector<std::string> shapes = {"half_box", "box", "half_sphere", "cone", "pyramid"};
  double min_size = 0.1, max_size = 0.5;
  Contact contact = Contact::separate;
  double friction = 0;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using O = RecipeObstacles;
    visit(&O::count,
          FieldInfo{.name = "count", .unit = "", .meaning = "Obstacles in a scene", .range = Range::between(0, 10000)});
    visit(&O::shapes,
          FieldInfo{.name = "shapes",
                    .unit = "",
                    .meaning = "Shapes to draw from: box, half_box, sphere, half_sphere, cone, pyramid, cylinder"});
    visit(&O::min_size, FieldInfo{.name = "min_size",
                                  .unit = "m",
                                  .meaning = "Smallest edge, diameter or height",
                                  .range = Range::positive()});
    visit(&O::max_size, FieldInfo{.name = "max_size",
                                  .unit = "m",
                                  .meaning = "Largest edge, diameter or height",
                                  .range = Range::positive()});
    visit(&O::contact, FieldInfo{.name = "contact", .unit = "", .meaning = "Contact of all obstacles"});
    visit(&O::friction, FieldInfo{.name = "friction",
                                  .unit = "",
                                  .meaning = "Coulomb friction coefficient of all obstacles",
                                  .range = Range::not_negative()});
  }
};

struct SceneRecipe {
  std::string name;
  std::string description;
  Domain domain;
  Vec3d gravity = {0, -9.8, 0};
  std::map<std::string, MaterialConfig> materials;
  RecipeGroups groups;
  RecipeObstacles obstacles;
  TimeStep time_step;
  int64_t frames = 300;
  double frame_time = 1.0 / 60;
  RecipeCounts counts;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using R = SceneRecipe;
    visit(&R::name, FieldInfo{.name = "name", .unit = "", .meaning = "Short name"});
    visit(&R::description, FieldInfo{.name = "description", .unit = "", .meaning = "What the recipe draws"});
    visit(&R::domain, FieldInfo{.name = "domain", .unit = "", .meaning = "Domain, grid and walls"});
    visit(&R::gravity, FieldInfo{.name = "gravity", .unit = "m/s^2", .meaning = "Gravity"});
    visit(&R::materials, FieldInfo{.name = "materials", .unit = "", .meaning = "Materials by name", .required = true});
    visit(&R::groups, FieldInfo{.name = "groups", .unit = "", .meaning = "Groups of particles"});
    visit(&R::obstacles, FieldInfo{.name = "obstacles", .unit = "", .meaning = "Obstacles"});
    visit(&R::time_step, FieldInfo{.name = "time_step", .unit = "", .meaning = "Step size"});
    visit(
        &R::frames,
        FieldInfo{.name = "frames", .unit = "", .meaning = "Frames after the first", .range = Range::between(1, 1e6)});
    visit(&R::frame_time,
          FieldInfo{.name = "frame_time", .unit = "s", .meaning = "Time between frames", .range = Range::positive()});
    visit(&R::counts, FieldInfo{.name = "counts", .unit = "", .meaning = "Scenes of each split"});
  }
};

}  // namespace graupel
