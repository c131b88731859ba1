// Which of some ranges that follow each other holds an item, for host and device.
#pragma once

#include <cstdint>

#include "core/parallel/host_device.h"

namespace graupel::graph::grid {

/// The one of `count` ranges that holds item i; begin[r] <= i < begin[r + 1].
GRAUPEL_HD inline int range_of(const int32_t* begin, int count, int64_t i) {
  int low = 0, high = count;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (begin[middle] <= i ? low : high) = middle;
  }
  return low;
}

}  // namespace graupel::graph::grid
