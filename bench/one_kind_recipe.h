// Recipes that benchmarks draw scenes from.
#pragma once

#include <string>

#include "core/system/error.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"

namespace graupel::bench {

/// As io::read_recipe. Throws ConfigError for a recipe of categories, whose scenes differ too much to be timed
/// together.
inline SceneRecipe read_one_kind_recipe(const std::string& path) {
  if (io::is_category_recipe(path))
    throw ConfigError("'" + path + "' is a recipe of categories; this benchmark takes recipes of one kind " +
                      "(scenes/recipes/hgn.json)");
  return io::read_recipe(path);
}

}  // namespace graupel::bench
