// A recipe of categories: random scenes of several kinds, with ranges of material constants, sizes, speeds and
// contacts.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/scene/recipes/category_parts.h"
#include "core/scene/recipes/scene_recipe.h"

namespace graupel {

enum class SceneCategory {
  dam_break,          ///< a block of water at a wall
  column_collapse,    ///< columns of sand or snow on the floor
  fall_on_obstacles,  ///< bodies that fall from rest
  thrown_bodies,      ///< bodies with velocity and spin
  snow_impact,        ///< snow thrown at an obstacle, a wall or the floor
  stream,             ///< emitters
  moving_obstacle,    ///< a paddle that turns, a box that slides or a tray that tilts
  filling_container   ///< a container filled by a stream or by falling bodies
};
template <>
struct EnumWords<SceneCategory> {
  static constexpr std::pair<const char*, SceneCategory> words[] = {
      {"dam_break", SceneCategory::dam_break},
      {"column_collapse", SceneCategory::column_collapse},
      {"fall_on_obstacles", SceneCategory::fall_on_obstacles},
      {"thrown_bodies", SceneCategory::thrown_bodies},
      {"snow_impact", SceneCategory::snow_impact},
      {"stream", SceneCategory::stream},
      {"moving_obstacle", SceneCategory::moving_obstacle},
      {"filling_container", SceneCategory::filling_container}};
};

/// The models of which a category needs at least one; empty: any model will do.
inline std::vector<MaterialModel> models_of(SceneCategory category) {
  if (category == SceneCategory::dam_break) return {MaterialModel::water};
  if (category == SceneCategory::column_collapse) return {MaterialModel::sand, MaterialModel::snow};
  if (category == SceneCategory::snow_impact) return {MaterialModel::snow};
  return {};
}

struct CategoryRecipe {
  std::string name;
  std::string description;
  std::vector<SceneCategory> categories;
  RecipeDomain domain;
  Vec3d gravity = {0, -9.8, 0};
  std::map<std::string, RecipeMaterial> materials;
  RecipeBodies bodies;
  RecipeFixedObstacles obstacles;
  RecipeStreams streams;
  RecipeMotions motions;
  int64_t max_particles = 20000;
  TimeStep time_step;
  int64_t frames = 240;
  double frame_time = 1.0 / 60;
  std::string fields_stored = "affine,plastic";
  RecipeCounts counts;

  /// Scene `index` of a split has this category.
  SceneCategory category(int64_t index) const {
    return categories[static_cast<std::size_t>(index % static_cast<int64_t>(categories.size()))];
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using R = CategoryRecipe;
    visit(&R::name, FieldInfo{"name", "", "Short name"});
    visit(&R::description, FieldInfo{"description", "", "What the recipe draws"});
    visit(&R::categories, FieldInfo{"categories", "",
                                    "Kinds of scenes: scene i of a split is of kind i mod n; this key makes a recipe "
                                    "one of categories"}
                              .mandatory());
    visit(&R::domain, FieldInfo{"domain", "", "Domain, grid and walls"});
    visit(&R::gravity, FieldInfo{"gravity", "m/s^2", "Gravity"});
    visit(&R::materials, FieldInfo{"materials", "", "Materials by name"}.mandatory());
    visit(&R::bodies, FieldInfo{"bodies", "", "Bodies of material"});
    visit(&R::obstacles, FieldInfo{"obstacles", "", "Obstacles"});
    visit(&R::streams, FieldInfo{"streams", "", "Emitters"});
    visit(&R::motions, FieldInfo{"motions", "", "Scripts of moving obstacles"});
    visit(&R::max_particles,
          FieldInfo{"max_particles", "", "Most particles in a scene: bodies are shrunk or left out, streams cut short",
                    Range::between(1, 1e9)});
    visit(&R::time_step, FieldInfo{"time_step", "", "Step size of all scenes"});
    visit(&R::frames, FieldInfo{"frames", "", "Frames after the first", Range::between(1, 1e6)});
    visit(&R::frame_time, FieldInfo{"frame_time", "s", "Time between frames", Range::positive()});
    visit(&R::fields_stored,
          FieldInfo{"fields", "", "Fields stored in every frame: stress,affine,deformation_gradient,plastic"});
    visit(&R::counts, FieldInfo{"counts", "", "Scenes of each split"});
  }
};

}  // namespace graupel
