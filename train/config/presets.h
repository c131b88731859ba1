// Settings that a new run begins with: those that did best (docs/lab/networks-against-mpm.md), or the paper's.
#pragma once

#include <string>
#include <vector>

#include "train/config/network_config.h"

namespace graupel::train {

enum class Preset {
  recommended,  ///< what won in our measurements
  paper         ///< HGN paper, section 3.3 (GNS as it is compared with there)
};

/// Overrides ("key=value") of TrainConfig's defaults.
std::vector<std::string> preset_settings(Architecture architecture, Preset preset);

}  // namespace graupel::train
