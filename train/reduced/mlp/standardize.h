// Numbers of fields to mean 0 and variance 1, and back.
#pragma once

#include <cstddef>
#include <vector>

#include "rom/networks/standardization.h"

namespace graupel::train {

/// Mean and one over the standard deviation of `width` interleaved numbers; 1 where they do not vary.
rom::Standardization standardization_of(const std::vector<float>& values, std::size_t width);
/// In place, of as many interleaved numbers as `s` has.
void standardize(std::vector<float>& values, const rom::Standardization& s);
/// From a network's own numbers back to the field's.
rom::Standardization inverse_scale(rom::Standardization s);

}  // namespace graupel::train
