#include "experiments/data/stored_scene.h"

#include "core/system/error.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

StoredScene stored_scene(const std::string& text, const std::string& file) {
  StoredScene stored;
  if (text.empty()) return stored;
  const std::string name = file + " (its scene)";
  try {
    stored.whole = io::parse_stored_scene(text, name, file);
  } catch (const Error& error) {
    stored.problem = error.what();
  }
  if (stored.whole) return stored;
  try {
    stored.keys = io::parse_scene_keys(text, name);
  } catch (const Error&) {  // `problem` tells it
  }
  return stored;
}

}  // namespace graupel::experiments
