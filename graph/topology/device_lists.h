// Running sums of integers where they lie, in the order of a stream. Results are the same on every device.
#pragma once

#include <cstdint>

#include "core/parallel/buffer.h"
#include "core/parallel/host_device.h"

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
/// last does not count. With `present`, a number of the device's memory that is at most n, it takes n's place.
void prefix_sums(Device device, int64_t n, const int32_t* value, int32_t* sums, ListScratch& scratch, void* stream,
                 const int32_t* present = nullptr);
void prefix_sums(Device device, int64_t n, const LinkCount* value, LinkCount* sums, ListScratch& scratch, void* stream,
                 const int32_t* present = nullptr);
/// The same for the numbers of bits that are set in `words` [n].
void count_bits(Device device, int64_t n, const uint32_t* words, int32_t* sums, ListScratch& scratch, void* stream);

}  // namespace graupel::graph
