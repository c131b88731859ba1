#include "library/io.h"

namespace graupel {

Scene checked_scene(const Scene& scene, const std::string& folder) {
  Scene named = scene;
  for (auto& [name, material] : named.materials) material.name = name;
  return io::parse_scene(io::scene_to_json(named), scene.name.empty() ? "scene made in code" : scene.name, folder);
}

}  // namespace graupel
