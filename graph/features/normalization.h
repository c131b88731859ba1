// The normalisation statistics of a network in its weights file: tensors normalization.velocity_mean, .velocity_std,
// .acceleration_mean, .acceleration_std, each f32 [3].
#pragma once

#include "graph/config/hgn_config.h"
#include "nn/weights.h"

namespace graupel::graph {

/// Throws InputError when one is missing, has another shape or a standard deviation is not positive.
Normalization read_normalization(const nn::Weights& weights);
void add_normalization(nn::Weights& weights, const Normalization& normalization);

}  // namespace graupel::graph
