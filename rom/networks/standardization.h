// Shift and scale of the numbers that go into a network and come out of it, a component each.
#pragma once

#include <string>
#include <vector>

#include "nn/weights.h"

namespace graupel::rom {

/// Inputs: (value - shift) * scale. Outputs: value * scale + shift.
struct Standardization {
  std::vector<double> shift, scale;
};

/// The same in the precision that files keep.
Standardization rounded(const Standardization& s);

/// Tensors <prefix>.shift and .scale [count]. Throws InputError as nn::Weights::get, and for a scale of 0.
Standardization load_standardization(const nn::Weights& weights, const std::string& prefix, int count);
void store_standardization(nn::Weights& weights, const std::string& prefix, const Standardization& s);

}  // namespace graupel::rom
