// Weights in numbers of another width: f16 and bf16 take half the bytes.
#pragma once

#include <string>

#include "nn/weights.h"

namespace graupel::nn {

/// Every tensor of floats in `numbers`: "f32", "f16" or "bf16", rounded to nearest even; integers stay. Throws
/// ConfigError for another word and where a number does not fit, naming the tensor.
void set_number_width(Weights& weights, const std::string& numbers);

}  // namespace graupel::nn
