// Set of integer cells with their numbers in (z, y, x) order: a dense window where the cells are close together, a
// hash table where they are not.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::sparsegrid {

/// Use: constructor with bounds, `insert` every cell, `number_cells` once, then `find`.
template <int D>
class CellTable {
 public:
  using Cell = Vec<int, D>;

  /// Cells to come lie in low..high (inclusive); `insertions` is about how many calls of insert will follow.
  CellTable(const Cell& low, const Cell& high, std::size_t insertions) : low_(low - Cell::filled(1)) {
    std::size_t window = 1;
    const std::size_t limit = std::max<std::size_t>(std::size_t(1) << 18, 16 * insertions);
    for (int d = 0; d < D; ++d) {
      size_[d] = high[d] - low[d] + 3;  // one cell of margin, so that neighbours are found without a test
      window = window > limit ? window : window * static_cast<std::size_t>(size_[d]);
    }
    dense_ = window <= limit;
    if (dense_)
      slot_.assign(window, none);
    else
      grow(std::bit_ceil(std::max<std::size_t>(insertions / 4, 64)));
  }

  void insert(const Cell& cell) {
    if (dense_) {
      slot_[offset(cell)] = 0;
      return;
    }
    if (2 * (keys_.size() + 1) > table_.size()) grow(2 * table_.size());
    const uint64_t k = key(cell);
    const std::size_t place = probe(k);
    if (table_[place] != free_key) return;
    table_[place] = k;
    keys_.push_back(k);
  }

  /// Numbers the cells in (z, y, x) order and returns them.
  std::vector<Cell> number_cells() {
    std::vector<Cell> cells;
    if (dense_) {
      Cell cell = low_;
      for (int32_t& slot : slot_) {
        if (slot != none) {
          slot = static_cast<int32_t>(cells.size());
          cells.push_back(cell);
        }
        for (int d = 0; d < D && ++cell[d] == low_[d] + size_[d] && d + 1 < D; ++d) cell[d] = low_[d];
      }
      return cells;
    }
    std::sort(keys_.begin(), keys_.end());
    slot_.assign(table_.size(), none);
    for (std::size_t i = 0; i < keys_.size(); ++i) {
      slot_[probe(keys_[i])] = static_cast<int32_t>(i);
      cells.push_back(cell_of(keys_[i]));
    }
    return cells;
  }

  /// Number of the cell, -1 when it is not in the set. The cell may lie up to one cell outside the bounds.
  int32_t find(const Cell& cell) const {
    if (dense_) return slot_[offset(cell)];
    const std::size_t place = probe(key(cell));
    return table_[place] == free_key ? none : slot_[place];
  }

 private:
  static constexpr int32_t none = -1;
  static constexpr uint64_t free_key = ~uint64_t(0);
  static constexpr int bits = 21;  ///< of a coordinate in a key
  static constexpr int shift = 1 << (bits - 1);

  std::size_t offset(const Cell& cell) const {
    std::size_t index = 0;
    for (int d = D - 1; d >= 0; --d)
      index = index * static_cast<std::size_t>(size_[d]) + static_cast<std::size_t>(cell[d] - low_[d]);
    return index;
  }
  /// Sorts as (z, y, x).
  static uint64_t key(const Cell& cell) {
    uint64_t k = 0;
    for (int d = D - 1; d >= 0; --d) k = k << bits | static_cast<uint64_t>((cell[d] + shift) & ((1 << bits) - 1));
    return k;
  }
  static Cell cell_of(uint64_t k) {
    Cell cell;
    for (int d = 0; d < D; ++d) cell[d] = static_cast<int>(k >> (bits * d) & ((1 << bits) - 1)) - shift;
    return cell;
  }
  /// Where the key is, or the free place where it would go.
  std::size_t probe(uint64_t k) const {
    std::size_t place = (k * 0x9E3779B97F4A7C15u) >> 20 & (table_.size() - 1);
    while (table_[place] != k && table_[place] != free_key) place = (place + 1) & (table_.size() - 1);
    return place;
  }
  void grow(std::size_t capacity) {
    table_.assign(capacity, free_key);
    for (const uint64_t k : keys_) table_[probe(k)] = k;
  }

  bool dense_ = true;
  Cell low_, size_;
  std::vector<int32_t> slot_;    ///< dense: number of each cell of the window; hash: number at each place
  std::vector<uint64_t> table_;  ///< hash: keys in open addressing
  std::vector<uint64_t> keys_;   ///< hash: the distinct keys
};

}  // namespace graupel::sparsegrid
