// A material starts from its preset, and is called by its key; include where structs with materials are read.
#pragma once

#include "core/scene/material_config.h"
#include "io/config/config_reader.h"

namespace graupel::io {

template <>
struct ConfigStart<MaterialConfig> {
  static void begin(const ConfigPlace& place, const std::string& key, MaterialConfig& out);
};

}  // namespace graupel::io
