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

/// The same of several frames [frames][n].
template <typename T, typename Index>
std::vector<std::vector<T>> frame_rows(const std::vector<std::vector<T>>& frames, const std::vector<Index>& chosen) {
  std::vector<std::vector<T>> rows;
  rows.reserve(frames.size());
  for (const std::vector<T>& frame : frames) rows.push_back(particle_rows(frame, chosen));
  return rows;
}

}  // namespace graupel
