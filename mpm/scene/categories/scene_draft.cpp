#include "mpm/scene/categories/scene_draft.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "core/system/error.h"

namespace graupel::mpm {

namespace {

/// Of the particles that a scene may have: sampling adds one or two a body.
constexpr double usable_share = 0.97;

bool is_one_of(MaterialModel model, const std::vector<MaterialModel>& models) {
  return models.empty() || std::find(models.begin(), models.end(), model) != models.end();
}

}  // namespace

SceneDraft::SceneDraft(const CategoryRecipe& recipe_, Draws& draws_) : recipe(recipe_), draws(draws_) {
  scene.gravity = recipe.gravity;
  scene.time_step = recipe.time_step;
  scene.frames = recipe.frames;
  scene.frame_time = recipe.frame_time;
  scene.domain.size = draws.one_of(recipe.domain.sizes);
  scene.domain.dx = recipe.domain.dx;
  scene.domain.wall_cells = recipe.domain.wall_cells;
  draw_walls();
}

Vec3d SceneDraft::point_in(const Part& part) const {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = low()[d] + draws.uniform(part.low[d], part.high[d]) * (high()[d] - low()[d]);
  return x;
}

WallConfig SceneDraft::wall(const RecipeSurface& surface) {
  const SurfaceKind kind = draws.one_of(surface.kinds);
  WallConfig wall;
  wall.kind = kind == SurfaceKind::slip ? Wall::slip : kind == SurfaceKind::stick ? Wall::stick : Wall::separate;
  if (kind == SurfaceKind::friction) wall.friction = draws.in(surface.friction);
  if (kind == SurfaceKind::separate || kind == SurfaceKind::slip) wall.friction = 0;
  return wall;
}

void SceneDraft::draw_walls() {
  const WallConfig floor = wall(recipe.domain.floor), others = wall(recipe.domain.walls);
  Faces& faces = scene.domain.faces;
  faces.y_low = floor;
  faces.x_low = faces.x_high = faces.z_low = faces.z_high = faces.y_high = others;
}

void SceneDraft::draw_materials(const std::vector<MaterialModel>& models) {
  const int64_t count = draws.whole(recipe.bodies.materials);
  for (int64_t i = 0; i < count; ++i) {
    std::vector<std::string> names;
    for (const auto& [name, material] : recipe.materials)
      if (i > 0 || is_one_of(material.model, models)) names.push_back(name);
    const std::string& drawn = draws.one_of(names);
    const RecipeMaterial& from = recipe.materials.at(drawn);
    MaterialConfig material = from;
    MaterialConfig::fields([&](auto member, const FieldInfo& info) {
      if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>)
        if (const auto range = from.ranges.find(std::string(info.name)); range != from.ranges.end())
          material.*member = draws.in(range->second);
    });
    std::string key = drawn;
    for (int copy = 2; scene.materials.count(key) > 0; ++copy) key = drawn + "_" + std::to_string(copy);
    material.name = key;
    scene.materials[key] = material;
  }
}

std::string SceneDraft::material(const std::vector<MaterialModel>& models) {
  std::vector<std::string> names;
  for (const auto& [name, material] : scene.materials)
    if (is_one_of(material.model, models)) names.push_back(name);
  GRAUPEL_ASSERT(!names.empty());
  return draws.one_of(names);
}

double SceneDraft::particle_volume() const { return scene.domain.cell_volume() / recipe.bodies.particles_per_cell; }

void SceneDraft::share_particles(int64_t n) { share_particles(n, 1e300); }

void SceneDraft::share_particles(int64_t n, double volume) {
  shares_.clear();
  double sum = 0;
  for (int64_t i = 0; i < n; ++i) sum += shares_.emplace_back(draws.uniform(0.3, 1));
  const double all = std::min(usable_share * static_cast<double>(recipe.max_particles), volume / particle_volume());
  for (double& share : shares_) share *= all / sum;
}

double SceneDraft::take_share() {
  const double share = shares_.empty() ? 0 : shares_.back();
  if (!shares_.empty()) shares_.pop_back();
  return share;
}

void SceneDraft::set_contact(Obstacle& obstacle) {
  const WallConfig drawn = wall(recipe.obstacles.surface);
  obstacle.contact = drawn.kind == Wall::slip    ? Contact::slip
                     : drawn.kind == Wall::stick ? Contact::stick
                                                 : Contact::separate;
  obstacle.friction = drawn.friction.value_or(0);
}

}  // namespace graupel::mpm
