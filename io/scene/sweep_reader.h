// Sweep recipes (core/scene/recipes/sweep_recipe.h): JSON with comments, checked like scenes; and the scenes of their
// runs.
#pragma once

#include <string>
#include <vector>

#include "core/scene/recipes/sweep_recipe.h"
#include "core/scene/scene.h"

namespace graupel::io {

/// A sweep that has been read, and the scenes of its runs.
struct Sweep {
  SweepRecipe recipe;
  std::string base_scene;     ///< the scene file as JSON on one line, before any change
  std::vector<Scene> scenes;  ///< [runs]

  int64_t run_count() const { return static_cast<int64_t>(scenes.size()); }
  /// "run 4 (friction_angle = 22.5 degrees)".
  std::string run_text(int64_t run) const;
};

/// Whether the recipe file is a sweep: it names a scene. Throws as parse_json does, and InputError for a missing file.
bool is_sweep(const std::string& path);

/// Reads a sweep. `overrides` are "key.path=value" of the recipe, and "scene.key.path=value" of its scene, which go to
/// the recipe's `set`. Throws ConfigError for a bad recipe, and for a run whose scene is bad, naming the parameter that
/// makes it so; InputError for a missing file.
Sweep read_sweep(const std::string& path, const std::vector<std::string>& overrides = {});
/// Every field, as JSON that read_sweep reads back to the same recipe.
std::string sweep_to_json(const SweepRecipe& recipe);

}  // namespace graupel::io
