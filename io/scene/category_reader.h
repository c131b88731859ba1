// Recipes of categories (core/scene/recipes/category_recipe.h): JSON with comments, checked like scenes.
#pragma once

#include <string>
#include <vector>

#include "core/scene/recipes/category_recipe.h"

namespace graupel::io {

/// Whether the recipe file is one of categories: it has that key. Throws as parse_json does, and InputError for a
/// missing file.
bool is_category_recipe(const std::string& path);

/// Reads a recipe and the geometry it names (paths relative to its folder); `overrides` are "key.path=value". Throws
/// ConfigError for a bad recipe, InputError for a missing or damaged file.
CategoryRecipe read_category_recipe(const std::string& path, const std::vector<std::string>& overrides = {});
/// What is wrong with a recipe file, as scene_mistakes; of the checks between keys the first.
std::vector<std::string> category_recipe_mistakes(const std::string& path);
/// Every field, as JSON that read_category_recipe reads back to the same recipe.
std::string category_recipe_to_json(const CategoryRecipe& recipe);

}  // namespace graupel::io
