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
    visit(&C::train, FieldInfo{"train", "", "Training scenes", Range::between(0, 1e6)});
    visit(&C::valid, FieldInfo{"valid", "", "Validation scenes", Range::between(0, 1e6)});
    visit(&C::test, FieldInfo{"test", "", "Test scenes", Range::between(0, 1e6)});
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
    visit(&G::count, FieldInfo{"count", "", "Groups of particles in a scene", Range::between(1, 10000)});
    visit(&G::shapes, FieldInfo{"shapes", "", "Shapes to draw from: sphere, box"});
    visit(&G::materials, FieldInfo{"materials", "", "Materials to draw from; default: all of the recipe's"});
    visit(&G::size, FieldInfo{"size", "m", "Edge of a box, diameter of a sphere", Range::positive()});
    visit(&G::max_speed, FieldInfo{"max_speed", "m/s", "Initial velocity: uniform direction, speed uniform up to this",
                                   Range::not_negative()});
    visit(&G::mixed_share, FieldInfo{"mixed_share", "",
                                     "Share of the groups that are cut along a random axis in halves of two materials",
                                     Range::between(0, 1)});
    visit(&G::particles_per_cell, FieldInfo{"particles_per_cell", "", "Particles in a grid cell", Range::positive()});
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
    visit(&O::count, FieldInfo{"count", "", "Obstacles in a scene", Range::between(0, 10000)});
    visit(&O::shapes,
          FieldInfo{"shapes", "", "Shapes to draw from: box, half_box, sphere, half_sphere, cone, pyramid, cylinder"});
    visit(&O::min_size, FieldInfo{"min_size", "m", "Smallest edge, diameter or height", Range::positive()});
    visit(&O::max_size, FieldInfo{"max_size", "m", "Largest edge, diameter or height", Range::positive()});
    visit(&O::contact, FieldInfo{"contact", "", "Contact of all obstacles"});
    visit(&O::friction,
          FieldInfo{"friction", "", "Coulomb friction coefficient of all obstacles", Range::not_negative()});
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
    visit(&R::name, FieldInfo{"name", "", "Short name"});
    visit(&R::description, FieldInfo{"description", "", "What the recipe draws"});
    visit(&R::domain, FieldInfo{"domain", "", "Domain, grid and walls"});
    visit(&R::gravity, FieldInfo{"gravity", "m/s^2", "Gravity"});
    visit(&R::materials, FieldInfo{"materials", "", "Materials by name"}.mandatory());
    visit(&R::groups, FieldInfo{"groups", "", "Groups of particles"});
    visit(&R::obstacles, FieldInfo{"obstacles", "", "Obstacles"});
    visit(&R::time_step, FieldInfo{"time_step", "", "Step size"});
    visit(&R::frames, FieldInfo{"frames", "", "Frames after the first", Range::between(1, 1e6)});
    visit(&R::frame_time, FieldInfo{"frame_time", "s", "Time between frames", Range::positive()});
    visit(&R::counts, FieldInfo{"counts", "", "Scenes of each split"});
  }
};

}  // namespace graupel
