// Points no two of which are closer than a given distance, taken from candidates that are tried one after the other
// (dart throwing). Space is cut into tiles; those of one parity are a tile apart, so that their candidates are tried
// side by side, and the points do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <vector>

#include "core/math/vec.h"
#include "core/parallel/parallel_for.h"

namespace graupel::sparsegrid {

class PoissonDisk {
 public:
  explicit PoissonDisk(double distance) : distance2_(distance * distance), inverse_(1 / distance) {}

  using Pieces = std::vector<std::vector<Vec3d>>;

  /// Tries candidates [same unit as the distance], in a scattered but fixed order in each tile; 1 for those taken. None
  /// of them is closer than the distance to another one or to one of an earlier call; each refused one is.
  std::vector<std::vector<char>> take(const Pieces& candidates) {
    std::vector<std::vector<char>> taken(candidates.size());
    for (std::size_t piece = 0; piece < taken.size(); ++piece) taken[piece].resize(candidates[piece].size());
    const std::vector<Tried> tried = by_tile(candidates);
    for (int parity = 0; parity < 8; ++parity) {
      const auto throw_in_tile = [&](int64_t tile) {
        const Tried& t = tried[static_cast<std::size_t>(tile)];
        if (parity_of(tiles_[t.tile].place) == parity) throw_darts(t, candidates, taken);
      };
      parallel_for_cpu(static_cast<int64_t>(tried.size()), throw_in_tile, Grain{4});
    }
    return taken;
  }

 private:
  static constexpr int cells = 8;                  ///< a tile's cells along an axis, two distances wide
  static constexpr double tile_width = 2 * cells;  ///< [distances]
  struct Point {
    Vec3d x;
    int16_t next;  ///< the point taken before this one in the same cell, -1 for none
  };
  struct Tile {
    explicit Tile(const Vec3i& at) : place(at) { head.fill(-1); }
    Vec3i place;
    std::array<int16_t, cells * cells * cells> head;  ///< last point taken in a cell, -1 for none
    std::vector<Point> points;                        ///< fewer than 2^15: 16^3 distances hold less than 7,000
  };
  struct Candidate {
    uint32_t piece, number;
  };
  struct Tried {
    std::size_t tile;
    std::vector<Candidate> candidates;
  };

  static uint64_t key(const Vec3i& place) {
    constexpr uint64_t mask = (uint64_t(1) << 21) - 1;
    return (static_cast<uint64_t>(place[0]) & mask) | (static_cast<uint64_t>(place[1]) & mask) << 21 |
           (static_cast<uint64_t>(place[2]) & mask) << 42;
  }
  static int parity_of(const Vec3i& place) { return (place[0] & 1) | (place[1] & 1) << 1 | (place[2] & 1) << 2; }
  Vec3i tile_of(const Vec3d& x) const {
    Vec3i place;
    for (int d = 0; d < 3; ++d) place[d] = static_cast<int>(std::floor(x[d] * inverse_ / tile_width));
    return place;
  }

  /// The candidates of each tile. Candidates of a piece are mostly neighbours, so the tile is mostly that of the last
  /// one.
  std::vector<Tried> by_tile(const Pieces& candidates) {
    std::vector<Tried> tried;
    std::unordered_map<std::size_t, std::size_t> place_in_tried;
    std::size_t last = 0;
    for (uint32_t piece = 0; piece < candidates.size(); ++piece)
      for (uint32_t i = 0; i < candidates[piece].size(); ++i) {
        const Vec3i place = tile_of(candidates[piece][i]);
        if (tried.empty() || !(tiles_[tried[last].tile].place == place)) {
          const auto [tile, is_new] = tile_numbers_.try_emplace(key(place), tiles_.size());
          if (is_new) tiles_.emplace_back(place);
          const auto [at, is_first] = place_in_tried.try_emplace(tile->second, tried.size());
          if (is_first) tried.push_back({tile->second, {}});
          last = at->second;
        }
        tried[last].candidates.push_back({piece, i});
      }
    return tried;
  }

  void throw_darts(const Tried& tried, const Pieces& candidates, std::vector<std::vector<char>>& taken) {
    Tile& own = tiles_[tried.tile];
    const std::array<const Tile*, 27> around = tiles_around(own.place);
    const std::size_t n = tried.candidates.size();
    std::size_t stride = static_cast<std::size_t>(0.6180339887 * static_cast<double>(n)) + 1;
    while (std::gcd(stride, n) > 1) ++stride;
    for (std::size_t i = 0, k = 0; i < n; ++i, k = (k + stride) % n) {
      const auto [piece, number] = tried.candidates[k];
      const Vec3d& x = candidates[piece][number];
      if (!is_free(around, own.place, x)) continue;
      taken[piece][number] = 1;
      add(own, x);
    }
  }

  std::array<const Tile*, 27> tiles_around(const Vec3i& place) const {
    std::array<const Tile*, 27> around;
    for (int k = 0; k < 27; ++k) {
      const auto found = tile_numbers_.find(key(place + Vec3i{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1}));
      around[static_cast<std::size_t>(k)] = found == tile_numbers_.end() ? nullptr : &tiles_[found->second];
    }
    return around;
  }

  /// Place of x in a tile [its cells], 0 to 8 within it.
  Vec3d in_cells(const Vec3i& place, const Vec3d& x) const {
    return x * (0.5 * inverse_) - place.template cast<double>() * static_cast<double>(cells);
  }

  bool is_free(const std::array<const Tile*, 27>& around, const Vec3i& place, const Vec3d& x) const {
    // Cells are two distances wide, so what is too close lies in one of two cells an axis.
    const Vec3d u = in_cells(place, x);
    int low[3];
    for (int d = 0; d < 3; ++d) low[d] = static_cast<int>(std::floor(u[d] - 0.5));
    for (int k = 0; k < 8; ++k) {
      const int cell[3] = {low[0] + (k & 1), low[1] + (k >> 1 & 1), low[2] + (k >> 2)};
      int tile = 0, in_tile = 0;
      for (int d = 2; d >= 0; --d) {
        const int side = cell[d] < 0 ? 0 : cell[d] < cells ? 1 : 2;
        tile = 3 * tile + side;
        in_tile = cells * in_tile + cell[d] - cells * (side - 1);
      }
      const Tile* const one = around[static_cast<std::size_t>(tile)];
      if (one == nullptr) continue;
      for (int16_t p = one->head[static_cast<std::size_t>(in_tile)]; p >= 0;
           p = one->points[static_cast<std::size_t>(p)].next)
        if (norm2(one->points[static_cast<std::size_t>(p)].x - x) < distance2_) return false;
    }
    return true;
  }

  void add(Tile& tile, const Vec3d& x) const {
    const Vec3d u = in_cells(tile.place, x);
    int in_tile = 0;
    for (int d = 2; d >= 0; --d) in_tile = cells * in_tile + std::clamp(static_cast<int>(u[d]), 0, cells - 1);
    int16_t& head = tile.head[static_cast<std::size_t>(in_tile)];
    tile.points.push_back({x, head});
    head = static_cast<int16_t>(tile.points.size() - 1);
  }

  double distance2_, inverse_;
  std::vector<Tile> tiles_;
  std::unordered_map<uint64_t, std::size_t> tile_numbers_;  ///< by key
};

}  // namespace graupel::sparsegrid
