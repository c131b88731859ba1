#include "io/scene/recipe_reader.h"

#include <algorithm>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/config_reader.h"
#include "io/config/config_writer.h"
#include "io/scene/material_start.h"
#include "io/scene/scene_checks.h"

namespace graupel::io {

namespace {

constexpr std::size_t largest_file = std::size_t(16) << 20;

/// What the declarations cannot say: the materials a group draws from exist, and sizes are in order.
void check_recipe(const ConfigDocument& document, const SceneRecipe& recipe) {
  if (recipe.materials.empty())
    config_fail(find_place(document, {"materials"}), "names no material", "Define at least one");
  for (std::size_t i = 0; i < recipe.groups.materials.size(); ++i) {
    const std::string& name = recipe.groups.materials[i];
    if (recipe.materials.count(name)) continue;
    std::vector<std::string_view> known;
    for (const auto& [key, material] : recipe.materials) known.push_back(key);
    config_fail(find_place(document, {"groups", "materials", std::to_string(i)}),
                "'" + name + "' is not in 'materials'", "Define it there or name another." + did_you_mean(name, known));
  }
  const RecipeGroups& groups = recipe.groups;
  if (groups.mixed_share > 0 && (groups.materials.empty() ? recipe.materials.size() : groups.materials.size()) < 2)
    config_fail(find_place(document, {"groups", "mixed_share"}),
                "needs two materials to draw from (" + number_text(groups.mixed_share) + ")",
                "Define another, or leave it out");
  if (recipe.domain.is_plane())
    config_fail(find_place(document, {"domain", "dimensions"}), "must be 3: recipes draw scenes in space (2)",
                "Leave it out");
  check_grid(find_place(document, {"domain", "size"}), recipe.domain);
  const Vec3d room = recipe.domain.wall_high() - recipe.domain.wall_low();
  if (const double widest = std::min({room[0], room[1], room[2]}); groups.count > 0 && groups.size >= widest)
    config_fail(find_place(document, {"groups", "size"}),
                "is too large for the room inside the walls (" + number_text(groups.size) + " m, allowed: below " +
                    number_text(widest) + ")",
                "Lower it, or enlarge the domain");
  if (recipe.obstacles.max_size < recipe.obstacles.min_size)
    config_fail(find_place(document, {"obstacles", "max_size"}),
                "is smaller than min_size (" + number_text(recipe.obstacles.min_size) + ")", "Swap them");
}

}  // namespace

bool is_recipe(const std::string& path) {
  const JsonNode root = parse_json(read_file(path, largest_file), path);
  const auto has = [&](const char* key) { return root.find(key) != nullptr; };
  return !has("sources") && (has("categories") || has("groups") || has("counts"));
}

SceneRecipe read_recipe(const std::string& path, const std::vector<std::string>& overrides) {
  const ConfigDocument document = parse_document<SceneRecipe>(read_file(path, largest_file), path, overrides);
  SceneRecipe recipe = read_config<SceneRecipe>(document);
  check_recipe(document, recipe);
  return recipe;
}

std::vector<std::string> recipe_mistakes(const std::string& path) {
  ConfigDocument document = ConfigDocument::parse(read_file(path, largest_file), path);
  std::vector<std::string> mistakes;
  document.mistakes = &mistakes;
  const auto recipe = read_config<SceneRecipe>(document);
  if (mistakes.empty()) document.attempt([&] { check_recipe(document, recipe); });
  return mistakes;
}

std::string recipe_to_json(const SceneRecipe& recipe) { return write_json(json_of(recipe), JsonLayout::indented); }

}  // namespace graupel::io
