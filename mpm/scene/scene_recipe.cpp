#include "mpm/scene/scene_recipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "mpm/scene/placement.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {

namespace {

Shape shape_named(const std::string& word, const char* key) {
  for (const auto& [name, shape] : EnumWords<Shape>::words)
    if (word == name && shape != Shape::plane && shape != Shape::mesh && shape != Shape::vdb && shape != Shape::points)
      return shape;
  throw ConfigError(
      fmt::format("recipe key '{}': shape '{}' cannot be drawn at random (allowed: box, half_box, sphere, half_sphere, "
                  "cone, pyramid, cylinder)",
                  key, word));
}

bool add_obstacles(const SceneRecipe& recipe, Draws& draws, int64_t& left, Scene& scene) {
  const RecipeObstacles& r = recipe.obstacles;
  for (int64_t i = 0; i < r.count; ++i) {
    Obstacle obstacle;
    obstacle.contact = r.contact;
    obstacle.friction = r.friction;
    const auto draw = [&]() -> const Obstacle& {
      obstacle.shape = shape_named(r.shapes[draws.integer(static_cast<uint32_t>(r.shapes.size()))], "obstacles.shapes");
      set_size(obstacle, draws.uniform(r.min_size, r.max_size));
      draws.rotation(obstacle.rotation_axis, obstacle.rotation_angle);
      obstacle.position = draws.point(scene.wall_low(), scene.wall_high());
      return obstacle;
    };
    const auto fits = [&](const Obstacle& o) {
      return std::none_of(scene.obstacles.begin(), scene.obstacles.end(),
                          [&](const Obstacle& other) { return overlap(o, other); });
    };
    if (!place(draw, fits, left)) return false;
    scene.obstacles.push_back(obstacle);
  }
  return true;
}

/// One half of a group: cut through its centre at right angles to an axis, the side that half bodies have after the
/// turn, or the other one.
Source half_of(const Source& group, int axis, bool other_side) {
  Source half = group;
  if (group.shape != Shape::box && group.shape != Shape::sphere)
    throw ConfigError(fmt::format(
        "recipe key 'groups.mixed_share' cuts spheres and boxes, and groups.shapes has '{}'. Leave one of them out",
        word_of(group.shape)));
  half.shape = group.shape == Shape::box ? Shape::half_box : Shape::half_sphere;
  half.rotation_axis = axis == 0 ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0};
  half.rotation_angle = (axis == 1 ? 0 : 90) + (other_side ? 180 : 0);
  return half;
}

/// The group, or, by chance, its halves of two materials.
void add_group(const RecipeGroups& recipe, const std::vector<std::string>& materials, const Source& group, Draws& draws,
               Scene& scene) {
  if (recipe.mixed_share == 0 || draws.uniform(0, 1) >= recipe.mixed_share) {
    scene.sources.push_back(group);
    return;
  }
  std::vector<std::string> others;
  std::copy_if(materials.begin(), materials.end(), std::back_inserter(others),
               [&](const std::string& name) { return name != group.material; });
  if (others.empty()) throw ConfigError("recipe key 'groups.mixed_share' needs two materials to draw from");
  const int axis = static_cast<int>(draws.integer(3));
  scene.sources.push_back(half_of(group, axis, false));
  scene.sources.push_back(half_of(group, axis, true));
  scene.sources.back().material = others[draws.integer(static_cast<uint32_t>(others.size()))];
}

bool add_groups(const SceneRecipe& recipe, Draws& draws, int64_t& left, Scene& scene) {
  const RecipeGroups& r = recipe.groups;
  std::vector<std::string> materials = r.materials;
  if (materials.empty())
    for (const auto& [name, material] : recipe.materials) materials.push_back(name);
  const Vec3d margin = Vec3d::filled(r.size / 2 + 1e-9);
  for (int64_t i = 0; i < r.count; ++i) {
    Source source;
    source.sampling = Sampling::random;
    source.particles_per_cell = r.particles_per_cell;
    set_size(source, r.size);
    const auto draw = [&]() -> const Source& {
      source.shape = shape_named(r.shapes[draws.integer(static_cast<uint32_t>(r.shapes.size()))], "groups.shapes");
      source.material = materials[draws.integer(static_cast<uint32_t>(materials.size()))];
      source.position = draws.point(scene.wall_low() + margin, scene.wall_high() - margin);
      source.velocity = draws.direction() * draws.uniform(0, r.max_speed);
      return source;
    };
    // A ball of the group's bounding radius must be free of obstacles, so that no particle starts within one.
    const auto fits = [&](const Source& s) {
      const double radius = s.shape == Shape::sphere ? r.size / 2 : r.size / 2 * std::sqrt(3.0);
      for (const Obstacle& o : scene.obstacles)
        if (sparsegrid::analytic_distance(o, o.to_local(s.position)) < radius + scene.domain.dx / 2) return false;
      return std::none_of(scene.sources.begin(), scene.sources.end(),
                          [&](const Source& other) { return overlap(s, other); });
    };
    if (!place(draw, fits, left)) return false;
    add_group(r, materials, source, draws, scene);
  }
  return true;
}

}  // namespace

const char* name_of(Split split) {
  switch (split) {
    case Split::train:
      return "train";
    case Split::valid:
      return "valid";
    case Split::test:
      return "test";
  }
  return "";
}

uint64_t stream_of(Split split, int64_t index, int64_t attempt) {
  return (static_cast<uint64_t>(split) << 60) | (static_cast<uint64_t>(attempt) << 40) | static_cast<uint64_t>(index);
}

uint64_t sampling_seed(uint64_t seed, Split split, int64_t index, int64_t attempt) {
  const auto words = Random(seed, RandomPurpose::scene_layout, stream_of(split, index, attempt)).words(~uint64_t{0});
  return (static_cast<uint64_t>(words.v[0]) << 32) | words.v[1];
}

Scene draw_scene(const SceneRecipe& recipe, uint64_t seed, Split split, int64_t index, int64_t attempt) {
  if (recipe.obstacles.count > 0 && recipe.obstacles.shapes.empty())
    throw ConfigError("recipe key 'obstacles.shapes' is empty. Name at least one shape");
  if (recipe.groups.shapes.empty()) throw ConfigError("recipe key 'groups.shapes' is empty. Name at least one shape");
  for (const std::string& name : recipe.groups.materials)
    if (!recipe.materials.count(name))
      throw ConfigError("recipe key 'groups.materials' names '" + name + "', which 'materials' does not define");
  Draws draws(seed, stream_of(split, index, attempt));
  // Early bodies can block the rest, so the whole layout is drawn anew when one does not fit. Of many bodies a draw
  // takes milliseconds, since it is held against all before it: the end comes in a minute or two all the same.
  int64_t left = 20000;
  for (int layout = 0; layout < 100 && left > 0; ++layout) {
    Scene scene;
    scene.name = fmt::format("{}-{}-{:05d}", recipe.name, name_of(split), index);
    scene.domain = recipe.domain;
    scene.gravity = recipe.gravity;
    scene.materials = recipe.materials;
    scene.time_step = recipe.time_step;
    scene.frames = recipe.frames;
    scene.frame_time = recipe.frame_time;
    scene.seed = sampling_seed(seed, split, index, attempt);
    if (add_obstacles(recipe, draws, left, scene) && add_groups(recipe, draws, left, scene)) return scene;
  }
  throw ConfigError(fmt::format(
      "no room for {} obstacles of {}-{} m and {} groups of {} m in scene {} of '{}'. Use fewer or smaller bodies",
      recipe.obstacles.count, recipe.obstacles.min_size, recipe.obstacles.max_size, recipe.groups.count,
      recipe.groups.size, index, recipe.name));
}

}  // namespace graupel::mpm
