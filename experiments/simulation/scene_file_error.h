// Errors of a scene's content that name its file.
#pragma once

#include <string>

#include "core/system/error.h"

namespace graupel::experiments {

/// Runs `body`; what it finds wrong with the scene is told with the name of the scene's file.
template <typename Body>
auto naming_file(const std::string& file, const Body& body) {
  try {
    return body();
  } catch (const ConfigError& error) {
    throw ConfigError(file + ": " + error.what());
  }
}

}  // namespace graupel::experiments
