// Running sums and stable sorts of integers where they lie, in the order of a stream. Results are the same on every
// device.
#pragma once

#include <cstdint>

#include "core/buffer.h"
#include "core/host_device.h"

namespace graupel::graph {

/// Memory of these operations, kept between calls: a recorded launch uses it again.
struct ListScratch {
  explicit ListScratch(Device device) : bytes(device, 0) {}
  Buffer<char> bytes;
};

/// Numbers of edges and children, summed together.
struct LinkCount {
  int32_t edges, children;
};
GRAUPEL_HD inline LinkCount operator+(const LinkCount& a, const LinkCount& b) {
  return {a.edges + b.edges, a.children + b.children};
}

/// sums[i] = value[0] + .. + value[i - 1] for i = 0 .. n: n + 1 results. `value` too has n + 1 places, of which the
/// last does not count.
void running_sums(Device device, int64_t n, const int32_t* value, int32_t* sums, ListScratch& scratch, void* stream);
void running_sums(Device device, int64_t n, const LinkCount* value, LinkCount* sums, ListScratch& scratch,
                  void* stream);

/// Items (key, value) in the order of their keys, equal keys in the order in which they stand; keys are in
/// [0, 2^bits).
void sort_by_key(Device device, int64_t n, int bits, const int32_t* key, const int32_t* value, int32_t* sorted_key,
                 int32_t* sorted_value, ListScratch& scratch, void* stream);

}  // namespace graupel::graph
