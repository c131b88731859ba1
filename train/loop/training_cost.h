// The offline cost that a weights file tells: of its data sets and of all training behind it.
#pragma once

#include <string>
#include <vector>

#include "nn/offline_cost.h"

namespace graupel::train {

/// What the data set in `folder` cost, from the "made_in" of its dataset.json; one part without seconds where it is not
/// told. The name is the recipe's, with a hash of what the card says of the scenes.
std::vector<nn::CostPart> data_cost(const std::string& folder);

/// The cost that a training starts with, and that of its data and of `seconds` on `device`.
nn::OfflineCost with_training(nn::OfflineCost start, const std::string& data_folder, double seconds,
                              const std::string& device);

}  // namespace graupel::train
