// Recipe files (core/scene/recipes/scene_recipe.h): JSON with comments, checked like scenes.
#pragma once

#include <string>
#include <vector>

#include "core/scene/recipes/scene_recipe.h"

namespace graupel::io {

/// Whether a JSON file is a recipe of random scenes, of categories or not, rather than a scene. Throws as parse_json
/// does, and InputError for a missing file.
bool is_recipe(const std::string& path);

/// Reads a recipe; `overrides` are "key.path=value". Throws ConfigError for a bad recipe, InputError for a missing
/// file.
SceneRecipe read_recipe(const std::string& path, const std::vector<std::string>& overrides = {});
/// What is wrong with a recipe file, as scene_mistakes; of the checks between keys the first.
std::vector<std::string> recipe_mistakes(const std::string& path);
/// Every field, as JSON that read_recipe reads back to the same recipe.
std::string recipe_to_json(const SceneRecipe& recipe);

}  // namespace graupel::io
