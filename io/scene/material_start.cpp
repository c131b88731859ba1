// Applies a material's preset before its other keys are read.
#include "io/scene/material_start.h"

namespace graupel::io {

void ConfigStart<MaterialConfig>::begin(const ConfigPlace& place, const std::string& key, MaterialConfig& out) {
  if (const JsonNode* node = place.node.find("preset"); node && !read_string(place.child("preset", *node)).empty()) {
    const auto& names = material_preset_names();
    const ConfigPlace preset = place.child("preset", *node);
    read_word(preset, {names.begin(), names.end()});
    out = *material_preset(node->text);
  }
  out.name = key;
}

}  // namespace graupel::io
