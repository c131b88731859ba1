// The report's 3-D player: its data as JSON and base64 blocks, its controls and its script (player.js).
#pragma once

#include <string>

#include "compare/comparison.h"

namespace graupel::compare {

std::string player_section(const Comparison& comparison);

}  // namespace graupel::compare
