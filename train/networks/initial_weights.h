// The weights file that `--from` names, as a run begins with it.
#pragma once

#include <string>

#include "nn/weights.h"
#include "train/config/network_config.h"

namespace graupel::train {

/// The weights of `file` for a network of these settings. The frames that it predicts at once may be others than the
/// file's: a frame takes the decoder's last layer of the file's frame of that number, else of the file's last one.
/// Throws InputError for files that are no network, ConfigError where another setting differs.
nn::Weights starting_weights(const std::string& file, const NetworkConfig& config);

}  // namespace graupel::train
