// Kernels of the grid builder (graph/grid_builder.cpp), for host and device: cells as bits, their links and pairs.
#pragma once

#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/host_device.h"
#include "core/vec.h"
#include "graph/device_lists.h"

namespace graupel::graph::grid {

inline constexpr int corners = 8;
inline constexpr int word_bits = 32;

/// The cells of one level of one scene that may be active, as bits of words.
struct Box {
  Vec3i low, size;     ///< [cells]
  int32_t first_word;  ///< of all words of all levels
};

GRAUPEL_HD inline bool inside(const Box& box, const Vec3i& cell) {
  for (int d = 0; d < 3; ++d)
    if (cell[d] < box.low[d] || cell[d] >= box.low[d] + box.size[d]) return false;
  return true;
}

/// Bit of a cell inside the box, over all words.
GRAUPEL_HD inline int64_t bit_of(const Box& box, const Vec3i& cell) {
  const Vec3i at = cell - box.low;
  return int64_t{word_bits} * box.first_word + (int64_t{at[2]} * box.size[1] + at[1]) * box.size[0] + at[0];
}

GRAUPEL_HD inline int ones(uint32_t word) {
#ifdef __CUDA_ARCH__
  return __popc(word);
#else
  return std::popcount(word);
#endif
}

/// Number of a word's lowest bit that is set.
GRAUPEL_HD inline int lowest_one(uint32_t word) {
#ifdef __CUDA_ARCH__
  return __ffs(static_cast<int>(word)) - 1;
#else
  return std::countr_zero(word);
#endif
}

GRAUPEL_HD inline void set_bit(uint32_t* words, int64_t bit) {
  uint32_t& word = words[bit / word_bits];
  const uint32_t mask = 1u << (bit % word_bits);
#ifdef __CUDA_ARCH__
  if ((*static_cast<volatile uint32_t*>(&word) & mask) == 0) atomicOr(&word, mask);
#else
  std::atomic_ref<uint32_t>(word).fetch_or(mask, std::memory_order_relaxed);
#endif
}

GRAUPEL_HD inline Vec3i corner_of(const Vec3i& base, int corner) {
  return {base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2 & 1)};
}

GRAUPEL_HD inline Vec3i coarser(const Vec3i& cell) { return {cell[0] >> 1, cell[1] >> 1, cell[2] >> 1}; }

/// The one of `count` ranges that holds item i; begin[r] <= i < begin[r + 1].
GRAUPEL_HD inline int range_of(const int32_t* begin, int count, int64_t i) {
  int low = 0, high = count;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (begin[middle] <= i ? low : high) = middle;
  }
  return low;
}

/// What all launches see. Box l * scenes + s is that of level l of scene s.
struct GridCells {
  int levels, scenes;
  double inverse_spacing;
  const Box* box;
  const Vec3d* origin;            ///< [scenes]
  const int32_t* particle_begin;  ///< [scenes + 1]
  const int32_t* word_begin;      ///< [levels * scenes + 1] words of each box
  uint32_t* words;
  const int32_t* rank;         ///< [words + 1] bits in the words before each
  const int32_t* level_begin;  ///< [levels + 1]

  GRAUPEL_HD int boxes() const { return levels * scenes; }
  /// Number of an active cell over all levels, or -1.
  GRAUPEL_HD int32_t number_of(const Box& in, const Vec3i& coordinate) const {
    if (!inside(in, coordinate)) return -1;
    const int64_t bit = bit_of(in, coordinate);
    const uint32_t word = words[bit / word_bits], mask = 1u << (bit % word_bits);
    return (word & mask) == 0 ? -1 : rank[bit / word_bits] + ones(word & (mask - 1));
  }
  /// Coordinate that a bit of a word of a box stands for.
  GRAUPEL_HD static Vec3i coordinate_of(const Box& box, int64_t word, int bit) {
    const int place = static_cast<int>(word - box.first_word) * word_bits + bit;
    return box.low + Vec3i{place % box.size[0], place / box.size[0] % box.size[1], place / box.size[0] / box.size[1]};
  }
};

/// Base cell, offset and weights of a particle; marks its eight cells.
struct Locate {
  GridCells k;
  const Vec3f* position;
  float *weight, *offset;
  Vec3i* base;
  int32_t* overflow;
  GRAUPEL_HD void operator()(int64_t p) const {
    const int s = range_of(k.particle_begin, k.scenes, p);
    const Box& box = k.box[s];
    Vec3i cell;
    Vec3f at;
    for (int d = 0; d < 3; ++d) {
      const double u = (static_cast<double>(position[p][d]) - k.origin[s][d]) * k.inverse_spacing - 0.5;
      const double floored = std::floor(u);
      const bool within = floored >= box.low[d] && floored + 1 < box.low[d] + box.size[d];  // false for NaN
      if (!within) *overflow = 1;
      cell[d] = within ? static_cast<int>(floored) : box.low[d];
      at[d] = within ? static_cast<float>(u - floored) : 0.0f;
      offset[3 * p + d] = at[d];
    }
    base[p] = cell;
    for (int c = 0; c < corners; ++c) {
      float w = 1;
      for (int d = 0; d < 3; ++d) w *= c >> d & 1 ? at[d] : 1 - at[d];
      weight[corners * p + c] = w;
      set_bit(k.words, bit_of(box, corner_of(cell, c)));
    }
  }
};

/// Marks the ancestors of the cells of one word of level 0.
struct MarkAncestors {
  GridCells k;
  GRAUPEL_HD void operator()(int64_t w) const {
    const int s = range_of(k.word_begin, k.scenes, w);
    const Box& box = k.box[s];
    for (uint32_t left = k.words[w]; left != 0; left &= left - 1) {
      Vec3i cell = GridCells::coordinate_of(box, w, lowest_one(left));
      for (int l = 1; l < k.levels; ++l) {
        cell = coarser(cell);
        set_bit(k.words, bit_of(k.box[l * k.scenes + s], cell));
      }
    }
  }
};

struct CountBits {
  const uint32_t* words;
  int32_t* count;
  GRAUPEL_HD void operator()(int64_t w) const { count[w] = ones(words[w]); }
};

/// Coordinates and boxes of the cells of a word; the first cells of levels that begin with it.
struct NumberCells {
  GridCells k;
  int32_t* level_begin;
  Vec3i* coordinate;
  int32_t* cell_box;
  GRAUPEL_HD void operator()(int64_t w) const {
    for (int l = 0; l <= k.levels; ++l)
      if (w == k.word_begin[l * k.scenes]) level_begin[l] = k.rank[w];
    if (w == k.word_begin[k.boxes()]) return;
    int32_t number = k.rank[w];
    const int b = range_of(k.word_begin, k.boxes(), w);
    for (uint32_t left = k.words[w]; left != 0; left &= left - 1, ++number) {
      coordinate[number] = GridCells::coordinate_of(k.box[b], w, lowest_one(left));
      cell_box[number] = b;
    }
  }
};

/// Neighbours, parent and octant of a cell; how many edges it receives and how many children it has.
struct LinkCell {
  GridCells k;
  const Vec3i* coordinate;
  const int32_t* cell_box;
  int32_t *neighbor, *parent, *octant;
  LinkCount* count;
  GRAUPEL_HD void operator()(int64_t i) const {
    const bool active = i < k.level_begin[k.levels];
    int edges = 0, children = 0;
    if (active) {
      const int b = cell_box[i], level = b / k.scenes;
      const Vec3i at = coordinate[i];
      for (int slot = 0; slot < 6; ++slot) {
        Vec3i next = at;
        next[slot / 2] += 2 * (slot & 1) - 1;
        const int32_t number = k.number_of(k.box[b], next);
        neighbor[6 * i + slot] = number < 0 ? -1 : number - k.level_begin[level];
        edges += number >= 0;
      }
      octant[i] = (at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2;
      if (level + 1 < k.levels) parent[i] = k.number_of(k.box[b + k.scenes], coarser(at)) - k.level_begin[level + 1];
      if (level > 0)
        for (int c = 0; c < corners; ++c) children += k.number_of(k.box[b - k.scenes], corner_of(at * 2, c)) >= 0;
    }
    count[i] = {edges, children};
  }
};

/// Edges that a cell receives, and its children, from where those of each cell begin.
struct WriteLinks {
  GridCells k;
  const Vec3i* coordinate;
  const int32_t *cell_box, *neighbor;
  const LinkCount* begin;
  int32_t *edge_begin, *child_begin, *sender, *receiver, *slot, *reverse, *child, *edge_level;
  GRAUPEL_HD void operator()(int64_t i) const {
    edge_begin[i] = begin[i].edges;
    child_begin[i] = begin[i].children;
    if (i <= k.levels) edge_level[i] = begin[k.level_begin[i]].edges;
    if (i >= k.level_begin[k.levels]) return;
    const int b = cell_box[i], level = b / k.scenes;
    const int32_t first_cell = k.level_begin[level], first_edge = begin[first_cell].edges;
    int32_t edge = begin[i].edges;
    for (int from = 0; from < 6; ++from) {
      const int32_t s = neighbor[6 * i + from];
      if (s < 0) continue;
      sender[edge] = s;
      receiver[edge] = static_cast<int32_t>(i) - first_cell;
      slot[edge] = from;
      // Links are mutual: the sender receives the reverse edge through the opposite slot.
      int32_t back = begin[first_cell + s].edges;
      for (int other = 0; other < (from ^ 1); ++other) back += neighbor[6 * (first_cell + s) + other] >= 0;
      reverse[edge] = back - first_edge;
      ++edge;
    }
    if (level == 0) return;
    int32_t place = begin[i].children;
    for (int c = 0; c < corners; ++c) {
      const int32_t number = k.number_of(k.box[b - k.scenes], corner_of(coordinate[i] * 2, c));
      if (number >= 0) child[place++] = number - k.level_begin[level - 1];
    }
  }
};

/// Cells of a particle's pairs, to be sorted.
struct FindPairs {
  GridCells k;
  const Vec3i* base;
  int32_t *cell, *key, *number;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t p = i / corners;
    const int s = range_of(k.particle_begin, k.scenes, p);
    cell[i] = k.number_of(k.box[s], corner_of(base[p], static_cast<int>(i % corners)));
    key[i] = cell[i];
    number[i] = static_cast<int32_t>(i);
  }
};

/// Where the sorted keys of each cell begin.
struct FindSegments {
  int64_t n;
  const int32_t* sorted_key;
  int32_t* begin;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t before = i == 0 ? -1 : sorted_key[i - 1], here = i == n ? before + 1 : sorted_key[i];
    for (int32_t c = before + 1; c <= here; ++c) begin[c] = static_cast<int32_t>(i);
  }
};

}  // namespace graupel::graph::grid
