// An interval of numbers, low <= high, both included; written [low, high] in configs.
#pragma once

#include <cstdint>

namespace graupel {

template <typename T>
struct IntervalOf {
  T low = 0, high = 0;

  bool contains(T x) const { return x >= low && x <= high; }
  bool operator==(const IntervalOf&) const = default;
};

using Interval = IntervalOf<double>;
using WholeInterval = IntervalOf<int64_t>;

}  // namespace graupel
