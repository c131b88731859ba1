// Draws a scene from a recipe.
#pragma once

#include <cstdint>
#include <string>

#include "core/scene/recipes/scene_recipe.h"
#include "core/scene/scene.h"

namespace graupel::mpm {

enum class Split { train, valid, test };
inline constexpr Split all_splits[] = {Split::train, Split::valid, Split::test};
const char* name_of(Split split);

/// Stream of the random numbers of a scene's layout.
uint64_t stream_of(Split split, int64_t index, int64_t attempt);

/// Scene `index` of a split. Depends on (recipe, seed, split, index, attempt) alone; `attempt` > 0 redraws a scene
/// whose run diverged. Throws ConfigError when no placement without overlaps is found (too many or too large bodies).
Scene draw_scene(const SceneRecipe& recipe, uint64_t seed, Split split, int64_t index, int64_t attempt = 0);

/// Seed of the particle sampling of that scene.
uint64_t sampling_seed(uint64_t seed, Split split, int64_t index, int64_t attempt);

}  // namespace graupel::mpm
