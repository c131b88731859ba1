// Points no two of which are closer than a given distance: a hash grid that accepts or refuses one point at a time.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace graupel::sparsegrid {

/// Cells of the hash grid are two distances wide, so the eight cells around a point hold all that may be too close.
class DartBoard {
 public:
  explicit DartBoard(double distance) : distance2_(distance * distance), inverse_(0.5 / distance) { grow(1024); }

  /// Takes x unless a taken point is closer than the distance.
  bool take(const Vec3d& x) {
    Vec<int64_t, 3> cell, side;
    for (int d = 0; d < 3; ++d) {
      const double u = x[d] * inverse_;
      cell[d] = static_cast<int64_t>(std::floor(u));
      side[d] = u - std::floor(u) < 0.5 ? -1 : 1;
    }
    for (int k = 0; k < 8; ++k)
      if (is_near(x, {cell[0] + (k & 1) * side[0], cell[1] + (k >> 1 & 1) * side[1], cell[2] + (k >> 2) * side[2]}))
        return false;
    if (2 * (cells_ + 1) > keys_.size()) grow(2 * keys_.size());
    const std::size_t place = probe(key(cell));
    if (keys_[place] == free_key) {
      keys_[place] = key(cell);
      head_[place] = -1;
      ++cells_;
    }
    points_.push_back({x, head_[place]});
    head_[place] = static_cast<int32_t>(points_.size() - 1);
    return true;
  }

 private:
  static constexpr uint64_t free_key = ~uint64_t(0);
  struct Point {
    Vec3d x;
    int32_t next;  ///< the point taken before this one in the same cell, -1 for none
  };

  static uint64_t key(const Vec<int64_t, 3>& cell) {
    constexpr uint64_t mask = (uint64_t(1) << 21) - 1;
    return (static_cast<uint64_t>(cell[0]) & mask) | (static_cast<uint64_t>(cell[1]) & mask) << 21 |
           (static_cast<uint64_t>(cell[2]) & mask) << 42;
  }
  std::size_t probe(uint64_t k) const {
    std::size_t place = (k * 0x9E3779B97F4A7C15u) >> 24 & (keys_.size() - 1);
    while (keys_[place] != k && keys_[place] != free_key) place = (place + 1) & (keys_.size() - 1);
    return place;
  }
  bool is_near(const Vec3d& x, const Vec<int64_t, 3>& cell) const {
    const std::size_t place = probe(key(cell));
    if (keys_[place] == free_key) return false;
    for (int32_t p = head_[place]; p >= 0; p = points_[p].next)
      if (norm2(points_[p].x - x) < distance2_) return true;
    return false;
  }
  void grow(std::size_t capacity) {
    std::vector<uint64_t> keys(capacity, free_key);
    std::vector<int32_t> head(capacity, -1);
    keys.swap(keys_);
    head.swap(head_);
    for (std::size_t i = 0; i < keys.size(); ++i)
      if (keys[i] != free_key) {
        const std::size_t place = probe(keys[i]);
        keys_[place] = keys[i];
        head_[place] = head[i];
      }
  }

  double distance2_, inverse_;
  std::vector<uint64_t> keys_;  ///< open addressing
  std::vector<int32_t> head_;   ///< last point taken in the cell of each key
  std::vector<Point> points_;
  std::size_t cells_ = 0;
};

}  // namespace graupel::sparsegrid
