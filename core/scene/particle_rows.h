// Rows of some particles among those of all.
#pragma once

#include <cstddef>
#include <vector>

namespace graupel {

/// Rows `chosen` of `all` [n]; none of an empty array, which stands for one that is not stored.
template <typename T, typename Index>
std::vector<T> particle_rows(const std::vector<T>& all, const std::vector<Index>& chosen) {
  std::vector<T> rows;
  if (all.empty()) return rows;
  rows.reserve(chosen.size());
  for (const Index i : chosen) rows.push_back(all[static_cast<std::size_t>(i)]);
  return rows;
}

}  // namespace graupel
