// Running sums and stable sorts of integers where they lie, in the order of a stream. Results are the same on every
// device.
#pragma once

#include <cstdint>

#include "core/buffer.h"

namespace graupel::graph {

/// Memory of these operations, kept between calls: a recorded launch uses it again.
struct ListScratch {
  explicit ListScratch(Device device) : bytes(device, 0) {}
  Buffer<char> bytes;
};

/// sums[i] = value[0] + .. + value[i - 1] for i = 0 .. n: n + 1 results.
void running_sums(Device device, int64_t n, const int32_t* value, int32_t* sums, ListScratch& scratch, void* stream);

/// Items (key, value) in the order of their keys, equal keys in the order in which they stand; keys are in
/// [0, 2^bits).
void sort_by_key(Device device, int64_t n, int bits, const int32_t* key, const int32_t* value, int32_t* sorted_key,
                 int32_t* sorted_value, ListScratch& scratch, void* stream);

}  // namespace graupel::graph
