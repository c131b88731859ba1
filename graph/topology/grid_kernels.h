// Kernels of the grid builder (graph/topology/grid_builder.cpp), for host and device: cells as bits, their links and
// pairs.
#pragma once

#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/math/vec.h"
#include "core/parallel/host_device.h"
#include "graph/topology/device_lists.h"
#include "graph/topology/range_search.h"

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
    const uint32_t mask = 1u << (bit % word_bits), word = words[bit / word_bits];
    const int32_t before = rank[bit / word_bits];
    return (word & mask) == 0 ? -1 : before + ones(word & (mask - 1));
  }
  /// Coordinate that a bit of a word of a box stands for.
  GRAUPEL_HD static Vec3i coordinate_of(const Box& box, int64_t word, int bit) {
    const int place = static_cast<int>(word - box.first_word) * word_bits + bit;
    return box.low + Vec3i{place % box.size[0], place / box.size[0] % box.size[1], place / box.size[0] / box.size[1]};
  }

  /// Where a particle lies among the cells of its scene: the lowest of its eight, and the offset from its centre. False
  /// for one outside the box (or NaN): it counts as one in the lowest cell.
  GRAUPEL_HD bool locate(const Vec3f& x, int scene, Vec3i& cell, Vec3f& offset) const {
    const Box& in = box[scene];
    bool all = true;
    for (int d = 0; d < 3; ++d) {
      const double u = (static_cast<double>(x[d]) - origin[scene][d]) * inverse_spacing - 0.5;
      const double floored = std::floor(u);
      const bool within = floored >= in.low[d] && floored + 1 < in.low[d] + in.size[d];
      cell[d] = within ? static_cast<int>(floored) : in.low[d];
      offset[d] = within ? static_cast<float>(u - floored) : 0.0f;
      all = all && within;
    }
    return all;
  }
};

/// Trilinear weight of a corner.
GRAUPEL_HD inline float weight_of(const Vec3f& offset, int corner) {
  float w = 1;
  for (int d = 0; d < 3; ++d) w *= corner >> d & 1 ? offset[d] : 1 - offset[d];
  return w;
}

/// Returns what the sum was before.
template <typename T>
GRAUPEL_HD inline T add_to(T& sum, T value) {
#ifdef __CUDA_ARCH__
  return atomicAdd(&sum, value);
#else
  return std::atomic_ref<T>(sum).fetch_add(value, std::memory_order_relaxed);
#endif
}

/// Base cell, offset and weights of a particle; marks its eight cells and their ancestors.
struct Locate {
  GridCells k;
  const Vec3f* position;
  float *weight, *offset;
  Vec3i* base;
  int32_t* overflow;
  GRAUPEL_HD void operator()(int64_t p) const {
    const int s = range_of(k.particle_begin, k.scenes, p);
    Vec3i cell;
    Vec3f at;
    if (!k.locate(position[p], s, cell, at)) *overflow = 1;
    base[p] = cell;
    for (int d = 0; d < 3; ++d) offset[3 * p + d] = at[d];
    for (int c = 0; c < corners; ++c) {
      weight[corners * p + c] = weight_of(at, c);
      mark(s, corner_of(cell, c));
    }
  }
  GRAUPEL_HD void mark(int scene, Vec3i cell) const {
    for (int l = 0; l < k.levels; ++l, cell = coarser(cell))
      set_bit(k.words, bit_of(k.box[l * k.scenes + scene], cell));
  }
};

/// Coordinate, neighbours, parent, octant and children of the cell that a bit stands for, where there is one; how many
/// edges it receives and how many children it has. Items 0 to levels also say where a level begins.
struct LinkCell {
  GridCells k;
  int64_t bits;
  int32_t* level_begin;
  Vec3i* coordinate;
  int32_t *cell_box, *neighbor, *parent, *octant, *children;
  LinkCount* count;  ///< null: not wanted
  GRAUPEL_HD int32_t first_of(int level) const { return k.rank[k.word_begin[level * k.scenes]]; }
  GRAUPEL_HD void operator()(int64_t item) const {
    if (item <= k.levels) level_begin[item] = first_of(static_cast<int>(item));
    if (item >= bits) return;
    const int64_t word = item / word_bits;
    const int bit = static_cast<int>(item % word_bits);
    const uint32_t set = k.words[word];
    if ((set >> bit & 1) != 0) link(word, bit, k.rank[word] + ones(set & ((1u << bit) - 1)));
  }
  GRAUPEL_HD void link(int64_t word, int bit, int32_t i) const {
    const int b = range_of(k.word_begin, k.boxes(), word);
    const Vec3i at = GridCells::coordinate_of(k.box[b], word, bit);
    describe(i, b, at);
    for (int slot = 0; slot < slots; ++slot) link_slot(i, b, at, slot);
    if (count) count[i] = count_of(i, b);
  }
  GRAUPEL_HD void describe(int32_t i, int b, const Vec3i& at) const {
    coordinate[i] = at;
    cell_box[i] = b;
    octant[i] = (at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2;
  }
  /// Of cell i: a neighbour, a child or the parent.
  static constexpr int slots = 15;
  GRAUPEL_HD void link_slot(int32_t i, int b, const Vec3i& at, int slot) const {
    const int level = b / k.scenes;
    if (slot < 6) {
      Vec3i next = at;
      next[slot / 2] += 2 * (slot & 1) - 1;
      neighbor[6 * int64_t{i} + slot] = number_within(b, level, next);
    } else if (slot < 14) {
      if (level > 0)
        children[corners * int64_t{i} + slot - 6] = number_within(b - k.scenes, level - 1, corner_of(at * 2, slot - 6));
    } else if (level + 1 < k.levels) {
      parent[i] = number_within(b + k.scenes, level + 1, coarser(at));
    }
  }
  GRAUPEL_HD int32_t number_within(int b, int level, const Vec3i& at) const {
    const int32_t first = first_of(level), number = k.number_of(k.box[b], at);
    return number < 0 ? -1 : number - first;
  }
  GRAUPEL_HD LinkCount count_of(int32_t i, int b) const {
    LinkCount sum{};
    for (int slot = 0; slot < 6; ++slot) sum.edges += neighbor[6 * int64_t{i} + slot] >= 0;
    for (int c = 0; b >= k.scenes && c < corners; ++c) sum.children += children[corners * int64_t{i} + c] >= 0;
    return sum;
  }
};

/// Cells of a particle's pairs, and a place for each pair among those of its cell, in any order.
struct FindPairs {
  GridCells k;
  const Vec3i* base;
  int32_t *cell, *place, *count;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t p = i / corners;
    const int s = range_of(k.particle_begin, k.scenes, p);
    cell[i] = k.number_of(k.box[s], corner_of(base[p], static_cast<int>(i % corners)));
    place[i] = add_to(count[cell[i]], 1);
  }
};

/// Two kinds of items in one launch.
template <typename A, typename B>
struct Both {
  int64_t of_a;
  A a;
  B b;
  GRAUPEL_HD void operator()(int64_t i) const { i < of_a ? a(i) : b(i - of_a); }
};

/// Edges that a cell receives, and its children, from where those of each cell begin.
struct WriteLinks {
  GridCells k;
  const int32_t *cell_box, *neighbor, *children;
  const LinkCount* begin;
  int32_t *edge_begin, *child_begin, *sender, *receiver, *slot, *reverse, *child, *edge_level;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (i > k.level_begin[k.levels]) return;
    edge_begin[i] = begin[i].edges;
    child_begin[i] = begin[i].children;
    if (i <= k.levels) edge_level[i] = begin[k.level_begin[i]].edges;
    if (i == k.level_begin[k.levels]) return;
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
    for (int c = 0; c < corners; ++c)
      if (children[corners * i + c] >= 0) child[place++] = children[corners * i + c];
  }
};

/// The pairs of each cell, in any order.
struct ListPairs {
  const int32_t *cell, *place, *begin;
  int32_t* listed;
  GRAUPEL_HD void operator()(int64_t i) const { listed[begin[cell[i]] + place[i]] = static_cast<int32_t>(i); }
};

/// Brings the pairs of each cell into their order, so that sums over them are the same every time: each counts those
/// before it. The lists of cells with very many stay as they are.
struct OrderPairs {
  static constexpr int32_t most = 4096;
  const int32_t *cell, *begin, *listed;
  int32_t* pair;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t own = listed[i], first = begin[cell[own]], last = begin[cell[own] + 1];
    int32_t place = 0;
    if (last - first > most)
      place = static_cast<int32_t>(i) - first;
    else
      for (int32_t other = first; other < last; ++other) place += listed[other] < own;
    pair[first + place] = own;
  }
};

}  // namespace graupel::graph::grid
