// Recipe files (core/scene/scene_recipe.h): JSON with comments, checked like scenes.
#pragma once

#include <string>
#include <vector>

#include "core/scene/scene_recipe.h"

namespace graupel::io {

/// Reads a recipe; `overrides` are "key.path=value". Throws ConfigError for a bad recipe, InputError for a missing
/// file.
SceneRecipe read_recipe(const std::string& path, const std::vector<std::string>& overrides = {});
/// Every field, as JSON that read_recipe reads back to the same recipe.
std::string recipe_to_json(const SceneRecipe& recipe);

}  // namespace graupel::io
