// What a block of persistent_layers.cu gathers: 16 lanes a row, eight columns a lane; the loads of a row are under way
// together.
#pragma once

#include "graph/cuda/aggregation/pair_aggregation.h"
#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/persistent/persistent_layers.h"
#include "graph/cuda/persistent/persistent_weights.h"

namespace graupel::graph::wide {

using namespace tile;

constexpr int tile_rows = 16;
constexpr int row_lanes = 16;
constexpr int words = layer_width / 8;  ///< of 16 bytes in a row of bf16 numbers
constexpr int most_slots = 8;           ///< links a row

/// Rows that other blocks wrote in this launch: not from the first cache.
__device__ inline uint4 row_word(const uint16_t* rows, int64_t row, int lane) {
  return __ldcg(reinterpret_cast<const uint4*>(rows) + row * words + lane);
}
/// A table in shared memory.
using Table = float[most_slots][layer_width];

__device__ inline uint4 packed(const float (&sum)[8]) {
  return {pack(sum[0], sum[1]), pack(sum[2], sum[3]), pack(sum[4], sum[5]), pack(sum[6], sum[7])};
}

/// Sums of eight numbers x and of their sizes: a(x) = (1 + slope) / 2 x + (1 - slope) / 2 |x|.
struct MessageAggregation {
  float plain[8] = {}, size[8] = {};
  /// Adds weight (u + v + t).
  __device__ void add(const uint4& u, const float (&v)[8], const float* t, float weight) {
    const uint32_t u_words[4] = {u.x, u.y, u.z, u.w};
    const float4 t_low = *reinterpret_cast<const float4*>(t), t_high = *reinterpret_cast<const float4*>(t + 4);
    const float t_of[8] = {t_low.x, t_low.y, t_low.z, t_low.w, t_high.x, t_high.y, t_high.z, t_high.w};
#pragma unroll
    for (int i = 0; i < 8; ++i) {
      const float2 pair = unpack(u_words[i / 2]);
      const float x = (i % 2 == 0 ? pair.x : pair.y) + (t_of[i] + v[i]);
      plain[i] += weight * x;
      size[i] += weight * fabsf(x);
    }
  }
  __device__ float activated(int i) const { return 0.5f * (1 + slope) * plain[i] + 0.5f * (1 - slope) * size[i]; }
};

/// Links of a tile's rows, and their weights, in shared memory: they are asked for while the tile before is worked on.
struct StagedLinks {
  __align__(16) int32_t link[tile_rows * most_slots];
  __align__(16) float weight[tile_rows * most_slots];
};

template <int bytes>
__device__ inline void copy_async(void* to, const void* from) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], %2;"
               :
               : "r"(shared_address(to)), "l"(from), "n"(bytes)
               : "memory");
}

__device__ inline int slots_of(Gather gather) {
  return gather == Gather::links                                   ? 6
         : gather == Gather::rows                                  ? 1
         : gather == Gather::children || gather == Gather::corners ? 8
                                                                   : 0;
}

/// Starts to copy them. Six links a row begin at multiples of eight bytes.
__device__ inline void stage_links(StagedLinks& to, const PersistentLayer& n, int64_t first_link, int64_t first,
                                   int64_t rows) {
  const int slots = slots_of(n.gather), i = static_cast<int>(threadIdx.x);
  const int count = slots * static_cast<int>(rows - first < tile_rows ? rows - first : tile_rows);
  const int64_t at = slots * (first_link + first);
  if (slots == 1) {
    if (i < count) copy_async<4>(to.link + i, n.link + at + i);
    return;
  }
  if (2 * i < count) copy_async<8>(to.link + 2 * i, n.link + at + 2 * i);
  if (n.gather == Gather::corners && 2 * i < count) copy_async<8>(to.weight + 2 * i, n.weight + at + 2 * i);
}

/// Sums over a fixed number of links; those that are missing count with weight 0.
template <int slots, bool weighted>
__device__ inline void sum_slots(MessageAggregation& sums, const PersistentLayer& n, const Table& table,
                                 const int32_t* link, const float* weights, int64_t row, int lane) {
  uint4 word[slots];
  float weight[slots];
#pragma unroll
  for (int k = 0; k < slots; k += 2) {
    const int2 pair = *reinterpret_cast<const int2*>(link + k);
    const int32_t from[2] = {pair.x, pair.y};
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      weight[k + i] = from[i] < 0 ? 0 : weighted ? weights[k + i] : 1.0f;
      word[k + i] = row_word(n.source, from[i] < 0 ? 0 : from[i], lane);
    }
  }
  float own[8] = {};
  if (n.own) add_numbers(own, row_word(n.own, row, lane));
#pragma unroll
  for (int k = 0; k < slots; ++k) sums.add(word[k], own, table[k] + 8 * lane, weight[k]);
}

/// Eight f32 numbers of a row, on their way to be rounded.
struct Wide {
  float4 low{0, 0, 0, 0}, high{0, 0, 0, 0};
  __device__ void load(const float* rows, int64_t row, int lane) {
    const float4* const from = reinterpret_cast<const float4*>(rows + row * layer_width) + 2 * lane;
    low = __ldcg(from);
    high = __ldcg(from + 1);
  }
  __device__ void add_to(float (&sum)[8]) const {
    sum[0] += low.x, sum[1] += low.y, sum[2] += low.z, sum[3] += low.w;
    sum[4] += high.x, sum[5] += high.y, sum[6] += high.z, sum[7] += high.w;
  }
  __device__ uint4 rounded() const {
    return {pack(low.x, low.y), pack(low.z, low.w), pack(high.x, high.y), pack(high.z, high.w)};
  }
};

/// A column of the three parts of a row's features (persistent_weights.h); 0 beyond them.
__device__ inline float feature_part(const float* features, int width, int column) {
  const int which = (column >= width) + (column >= 2 * width);
  const float x = column < feature_parts * width ? features[column - which * width] : 0.0f;
  const float high = from_bf16(static_cast<uint16_t>(pack(x, 0) & 0xffffu));
  return which == 1 ? x - high : high;
}
/// Columns first to first + 7 of the three parts of a row's features (persistent_weights.h).
__device__ inline uint4 feature_word(const float* features, int width, int first) {
  uint32_t word[4];
#pragma unroll
  for (int i = 0; i < 4; ++i)
    word[i] = pack(feature_part(features, width, first + 2 * i), feature_part(features, width, first + 2 * i + 1));
  return {word[0], word[1], word[2], word[3]};
}

static_assert(4 * most_persistent_features <= 2 * row_stride && feature_tiles(most_persistent_features) <= 2);
/// Features of a tile's rows in shared memory; all threads of the block.
__device__ inline void fetch_features(float* to, const PersistentLayer& n, int64_t first, int64_t rows) {
  const int count = n.width * static_cast<int>(rows - first < tile_rows ? rows - first : tile_rows);
  for (int i = static_cast<int>(threadIdx.x); i < count; i += threads) to[i] = __ldcg(n.rows32 + first * n.width + i);
  __syncthreads();
}

/// The parts of a tile's features. All threads of the block.
__device__ inline void gather_features(const PersistentLayer& n, int64_t first, int64_t rows, uint16_t* to0,
                                       uint16_t* to1, float* scratch) {
  fetch_features(scratch, n, first, rows);
  const int lane = static_cast<int>(threadIdx.x) % row_lanes;
  for (int i = static_cast<int>(threadIdx.x) / row_lanes; i < tile_rows; i += threads / row_lanes)
    for (int operand = 0; operand < n.operands; ++operand) {
      uint4 word{0, 0, 0, 0};
      if (first + i < rows) word = feature_word(scratch + i * n.width, n.width, operand * layer_width + 8 * lane);
      *reinterpret_cast<uint4*>((operand == 0 ? to0 : to1) + i * row_stride + 8 * lane) = word;
    }
}

/// Sums over a row's parts of the list of pairs (graph/cuda/aggregation/pair_aggregation.h).
__device__ inline void sum_parts(float (&sum)[8], const PersistentLayer& n, int64_t link_row, int64_t row, int lane) {
  constexpr int under_way = 4;
  const int32_t begin = __ldg(n.begin + link_row), end = __ldg(n.begin + link_row + 1);
  if (begin == end) return;
  const int32_t last = n.parts.part_of(end - 1);
  for (int32_t first = n.parts.part_of(begin); first <= last; first += under_way) {
    Wide part[under_way];
#pragma unroll
    for (int k = 0; k < under_way; ++k)
      if (first + k <= last) part[k].load(n.rows32, row + first + k, lane);
#pragma unroll
    for (int k = 0; k < under_way; ++k) part[k].add_to(sum);
  }
}

/// Gathers the operands of rows `first` and on into shared memory; rows beyond the last are 0. `scratch`: room for a
/// tile's features.
__device__ inline void gather(const PersistentLayer& n, const StagedLinks& staged, const Table& table,
                              int64_t first_link, int64_t first, int64_t rows, uint16_t* to0, uint16_t* to1,
                              float* scratch) {
  const int lane = static_cast<int>(threadIdx.x) % row_lanes;
  if (n.gather == Gather::features) {
    gather_features(n, first, rows, to0, to1, scratch);
    return;
  }
  for (int i = static_cast<int>(threadIdx.x) / row_lanes; i < tile_rows; i += threads / row_lanes) {
    const int64_t row = first + i;
    uint4 word{0, 0, 0, 0};
    Wide second;
    if (row < rows) {
      if (n.second) second.load(n.second, row, lane);  // under way together with what follows
      MessageAggregation sums;
      float sum[8] = {};
      Wide only;
      switch (n.gather) {
        case Gather::links:
          sum_slots<6, false>(sums, n, table, staged.link + 6 * i, nullptr, row, lane);
          break;
        case Gather::children:
          sum_slots<8, false>(sums, n, table, staged.link + 8 * i, nullptr, row, lane);
          break;
        case Gather::corners:
          sum_slots<8, true>(sums, n, table, staged.link + 8 * i, staged.weight + 8 * i, row, lane);
          break;
        case Gather::pairs:
          sum_parts(sum, n, first_link + row, row, lane);
          break;
        case Gather::rows:
          only.load(n.rows32, staged.link[i], lane);
          word = only.rounded();
          break;
        case Gather::features:
          break;
      }
      if (n.gather != Gather::rows) {
#pragma unroll
        for (int k = 0; k < 8; ++k) sum[k] = n.scale * (sum[k] + sums.activated(k));
        word = packed(sum);
      }
    }
    *reinterpret_cast<uint4*>(to0 + i * row_stride + 8 * lane) = word;
    if (n.operands > 1) *reinterpret_cast<uint4*>(to1 + i * row_stride + 8 * lane) = second.rounded();
  }
}

}  // namespace graupel::graph::wide
