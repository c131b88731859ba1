// A grid in one launch of blocks that wait for each other three times: the steps of graph/topology/grid_builder.cpp,
// for host and device. Pairs are counted where their cell's bit lies, so that their lists begin with the numbers of the
// cells.
#pragma once

#include "graph/topology/grid_kernels.h"

namespace graupel::graph {

struct GridProgram {
  int64_t particles, words, fine_words;  ///< words of all levels; of level 0, which come first
  const Vec3f* position;
  float *weight, *offset;
  /// Zero between launches, as are the words: pairs by bit of level 0 [32 fine_words], by word [fine_words]; whether a
  /// particle was outside.
  int32_t *bit_pairs, *word_pairs, *outside;
  int32_t* rank;           ///< [words]
  grid::LinkCell link;     ///< its counts are made last
  int32_t *cell, *place;   ///< [pairs]
  int32_t* pair_begin;     ///< [cells of level 0 + 1]
  int32_t *listed, *pair;  ///< [pairs]
  int32_t* overflow;
};

namespace grid {

/// What other blocks of the launch wrote: not from the first cache.
template <typename T>
GRAUPEL_HD inline T read_through(const T* place) {
#ifdef __CUDA_ARCH__
  return __ldcg(place);
#else
  return *place;
#endif
}

/// As set_bit, without a look at the bit first: few ask for one that is set.
GRAUPEL_HD inline void set_new_bit(uint32_t* words, int64_t bit) {
#ifdef __CUDA_ARCH__
  atomicOr(words + bit / word_bits, 1u << (bit % word_bits));
#else
  set_bit(words, bit);
#endif
}

/// Sets four numbers, of which the first begins at a multiple of 16 bytes, to 0.
GRAUPEL_HD inline void clear_quad(int32_t* numbers) {
#ifdef __CUDA_ARCH__
  *reinterpret_cast<int4*>(numbers) = {0, 0, 0, 0};
#else
  for (int k = 0; k < 4; ++k) numbers[k] = 0;
#endif
}

/// What one block does. A `Block` is one of block.count() blocks, each of block.threads() threads, as many together as
/// there are words or more:
///   Block::PerThread<T>             a value of each thread, by its number
///   for_threads(f)                  f(thread) by each of them
///   sum_before(values)              each value becomes the sum of those of the threads before; returns that of all
///   for_bits(words, used, of, f)    f(word, bit, sum of of(word, bit) over lower bits) by threads, for words in use
///   wait()                          for what its other threads have written
///   word, cells, pairs              arrays [threads] that its threads share
template <typename Block>
class BuildAtOnce {
 public:
  GRAUPEL_HD BuildAtOnce(const GridProgram& program, Block& block) : p_(program), k_(program.link.k), block_(block) {}

  // The parts, one after the other; all blocks are done with one before any begins the next.

  GRAUPEL_HD void mark_cells() {
    for_items(pairs(), [this](int64_t i) { mark(i); });
  }

  /// Numbers of the cells and of the first pair of each, by blocks of neighbouring words. Each block adds up by itself
  /// what lies before its own.
  GRAUPEL_HD void number_cells() {
    const int64_t each = (p_.words + block_.count() - 1) / block_.count(), first = block_.index() * each;
    const int64_t last = first + each < p_.words ? first + each : p_.words;
    if (first >= last) return;
    typename Block::template PerThread<int32_t> cells{}, pairs{};
    const int64_t counted = first < p_.fine_words ? first : p_.fine_words;
    block_.for_threads([&](int thread) {
      cells[thread] = sum_of_thread(thread, first, [this](int64_t w) { return ones(read_through(k_.words + w)); });
      pairs[thread] = sum_of_thread(thread, counted, [this](int64_t w) { return read_through(p_.word_pairs + w); });
    });
    const int32_t cells_before = block_.sum_before(cells), pairs_before = block_.sum_before(pairs);
    block_.for_threads([&](int thread) {
      const int64_t own = first + thread;
      const uint32_t word = own < last ? read_through(k_.words + own) : 0;
      block_.word[thread] = word;
      cells[thread] = ones(word);
      pairs[thread] = own < last ? pairs_of(own) : 0;
    });
    block_.sum_before(cells);
    block_.sum_before(pairs);
    block_.for_threads([&](int thread) {
      block_.cells[thread] = cells_before + cells[thread];
      block_.pairs[thread] = pairs_before + pairs[thread];
      if (first + thread < last) rank_word(first + thread, block_.word[thread], block_.cells[thread]);
    });
    block_.wait();
    block_.for_threads([&](int thread) {
      if (thread >= k_.levels) return;
      const int64_t w = k_.word_begin[thread * k_.scenes];
      if (w >= first && w < last) p_.link.level_begin[thread] = block_.cells[w - first];
    });
    block_.for_bits(
        first, last, [&](int64_t w) { return block_.word[w - first] != 0; },
        [&](int64_t w, int bit) { return w < p_.fine_words ? read_through(p_.bit_pairs + w * word_bits + bit) : 0; },
        [&](int64_t w, int bit, int32_t before) { describe_cell(w, w - first, bit, before); });
  }

  GRAUPEL_HD void link_cells() {
    const int64_t links = link_slots * cells();
    for_items(links + pairs(), [&](int64_t i) { i < links ? link(i) : list(i - links); });
  }

  /// And makes all ready for the next launch.
  GRAUPEL_HD void order_pairs() {
    for_items(pairs(), OrderPairs{p_.cell, p_.pair_begin, p_.listed, p_.pair});
    if (p_.link.count)
      for_items(cells(), [this](int64_t i) {
        p_.link.count[i] = p_.link.count_of(static_cast<int32_t>(i), p_.link.cell_box[i]);
      });
    clear();
  }

 private:
  static constexpr int link_slots = LinkCell::slots + 1;  ///< items a cell

  /// Items by all threads of all blocks.
  template <typename Body>
  GRAUPEL_HD void for_items(int64_t n, const Body& body) {
    block_.for_threads([&](int thread) {
      for (int64_t i = block_.index() * block_.threads() + thread; i < n; i += block_.count() * block_.threads())
        body(i);
    });
  }
  /// Of n items, by the threads of each block. Their loads are under way together.
  template <typename Of>
  GRAUPEL_HD int32_t sum_of_thread(int thread, int64_t n, const Of& of) const {
    int32_t sum = 0;
#ifdef __CUDA_ARCH__
#pragma unroll 8
#endif
    for (int64_t i = thread; i < n; i += block_.threads()) sum += of(i);
    return sum;
  }
  GRAUPEL_HD int64_t pairs() const { return corners * p_.particles; }
  GRAUPEL_HD int64_t cells() const { return read_through(p_.link.level_begin + k_.levels); }
  GRAUPEL_HD int32_t pairs_of(int64_t w) const { return w < p_.fine_words ? read_through(p_.word_pairs + w) : 0; }

  /// Counts pair i in its cell; the first one marks the cell and its ancestors.
  GRAUPEL_HD void mark(int64_t i) {
    const int64_t particle = i / corners;
    const int corner = static_cast<int>(i % corners), scene = range_of(k_.particle_begin, k_.scenes, particle);
    Vec3i base;
    Vec3f at;
    if (!k_.locate(p_.position[particle], scene, base, at)) *p_.outside = 1;
    Vec3i cell = corner_of(base, corner);
    const int64_t bit = bit_of(k_.box[scene], cell);
    const int32_t place = add_to(p_.bit_pairs[bit], 1);
    add_to(p_.word_pairs[bit / word_bits], 1);
    p_.weight[i] = weight_of(at, corner);
    if (corner < 3) p_.offset[3 * particle + corner] = at[corner];
    p_.cell[i] = static_cast<int32_t>(bit);
    p_.place[i] = place;
    for (int l = 0; place == 0 && l < k_.levels; ++l, cell = coarser(cell))
      set_new_bit(k_.words, bit_of(k_.box[l * k_.scenes + scene], cell));
  }

  /// A word and the cells before it. The last word of all and of level 0 ends their lists.
  GRAUPEL_HD void rank_word(int64_t w, uint32_t word, int32_t before) {
    p_.rank[w] = before;
    if (w == p_.words - 1) p_.link.level_begin[k_.levels] = before + ones(word);
    if (w == p_.fine_words - 1) p_.pair_begin[before + ones(word)] = static_cast<int32_t>(pairs());
  }

  /// `place` of a word among the block's; `pairs_before` of its lower bits.
  GRAUPEL_HD void describe_cell(int64_t w, int64_t place, int bit, int32_t pairs_before) {
    const uint32_t word = block_.word[place];
    if ((word >> bit & 1) == 0) return;
    const int32_t number = block_.cells[place] + ones(word & ((1u << bit) - 1));
    if (w < p_.fine_words) p_.pair_begin[number] = block_.pairs[place] + pairs_before;
    const int b = range_of(k_.word_begin, k_.boxes(), w);
    p_.link.describe(number, b, GridCells::coordinate_of(k_.box[b], w, bit));
  }

  GRAUPEL_HD void link(int64_t i) {
    const auto cell = static_cast<int32_t>(i / link_slots);
    const int slot = static_cast<int>(i % link_slots);
    if (slot < LinkCell::slots) p_.link.link_slot(cell, p_.link.cell_box[cell], p_.link.coordinate[cell], slot);
  }

  GRAUPEL_HD void list(int64_t i) {
    const int32_t bit = p_.cell[i];
    const uint32_t below = (1u << (bit % word_bits)) - 1;
    const int32_t number = k_.rank[bit / word_bits] + ones(k_.words[bit / word_bits] & below);
    p_.cell[i] = number;
    p_.listed[p_.pair_begin[number] + p_.place[i]] = static_cast<int32_t>(i);
  }

  GRAUPEL_HD void clear() {
    for_items(p_.words, [this](int64_t w) { k_.words[w] = 0; });
    for_items(p_.fine_words, [this](int64_t w) { p_.word_pairs[w] = 0; });
    for_items(p_.fine_words * (word_bits / 4), [this](int64_t i) { clear_quad(p_.bit_pairs + 4 * i); });
    for_items(1, [this](int64_t) {
      *p_.overflow = *p_.outside;
      *p_.outside = 0;
    });
  }

  const GridProgram& p_;
  const GridCells& k_;
  Block& block_;
};

}  // namespace grid

}  // namespace graupel::graph
