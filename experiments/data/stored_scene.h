// The scene that a trajectory stores, as far as it can be read.
#pragma once

#include <optional>
#include <string>

#include "core/scene/scene.h"

namespace graupel::experiments {

struct StoredScene {
  std::optional<Scene> whole;  ///< with its geometry
  std::optional<Scene> keys;   ///< meshes and points not loaded: there also where their files are not
  std::string problem = "the file stores no scene";  ///< why `whole` is not there

  /// What the keys tell: `whole`, else `keys`, else none.
  const Scene* best() const { return whole ? &*whole : keys ? &*keys : nullptr; }
};

/// Of the JSON text in the trajectory file `file`.
StoredScene stored_scene(const std::string& text, const std::string& file);

}  // namespace graupel::experiments
