// Draws a scene from a recipe of categories.
#pragma once

#include <cstdint>

#include "core/scene/recipes/category_recipe.h"
#include "mpm/scene/scene_recipe.h"

namespace graupel::mpm {

/// Scene `index` of a split, of the category index mod n. Depends on (recipe, seed, split, index, attempt) alone;
/// `attempt` > 0 redraws a scene whose run diverged. Its materials state the constants that were drawn. Throws
/// ConfigError when no layout is found, and when equal substeps are too long for the stiffest constants of the recipe
/// or, where they are fixed, for its fastest motion; InputError for an unusable .vdb file.
Scene draw_scene(const CategoryRecipe& recipe, uint64_t seed, Split split, int64_t index, int64_t attempt = 0);

/// Largest share of a cell that a wave, or the fastest particle or obstacle, crosses in one of equal substeps,
/// with the stiffest and lightest constants of the recipe; snow counts as unhardened.
double largest_courant(const CategoryRecipe& recipe);

}  // namespace graupel::mpm
