// Integers in weights files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/weights.h"

namespace graupel::rom {

nn::Tensor index_tensor(const std::vector<int32_t>& values);
/// Tensor `name` as indices; throws InputError unless it is there, i32, of one axis and not negative.
std::vector<int32_t> get_indices(const nn::Weights& weights, const std::string& name);
/// Length of an axis of a tensor; throws InputError when the tensor or the axis is not there.
int64_t extent(const nn::Weights& weights, const std::string& name, std::size_t axis);

}  // namespace graupel::rom
