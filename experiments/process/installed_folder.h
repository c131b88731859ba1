// Where models and scenes are: in a checkout, or where they were installed beside the program.
#pragma once

#include <string>

namespace graupel::experiments {

/// `folder` ("models"), where it is there, seen from here; else ../share/graupel/`folder` beside the program, or that
/// of the sources above a build folder, where that is there; else `folder`.
std::string or_installed(const std::string& folder);

}  // namespace graupel::experiments
