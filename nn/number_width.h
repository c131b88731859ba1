// Weights in numbers of another width: f16 and bf16 take half the bytes, i8 a quarter.
#pragma once

#include <string>

#include "nn/weights.h"

namespace graupel::nn {

/// Every tensor of floats in `numbers`: "f32", "f16" or "bf16", rounded to nearest even; integers stay. "i8": matrices
/// in 8 bits, the rest and those that begin with one of `keep` in f16 (nn/quantization.h). Throws ConfigError for
/// another word and where a number does not fit, naming the tensor.
void set_number_width(Weights& weights, const std::string& numbers, const std::vector<std::string>& keep = {});

}  // namespace graupel::nn
