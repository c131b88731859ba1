#include "graph/cuda/aggregation/pair_aggregation.h"

#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/persistent/persistent_gather.h"

namespace graupel::graph {

namespace {

using namespace wide;

constexpr int half_warps = threads / row_lanes, under_way = 8;

struct Shared {
  __align__(16) Table table;
};

/// A half warp's sums over one part of the list; a lane has eight columns.
class PartSums {
 public:
  __device__ PartSums(const PairAggregation& s, const Table& table, int32_t part)
      : s_(s),
        table_(table),
        part_(part),
        lane_(static_cast<int>(threadIdx.x) % row_lanes),
        mask_(0xffffu << (threadIdx.x / row_lanes % 2 * row_lanes)) {}

  /// Of places `begin` to `end` - 1 of the list.
  __device__ void run(int32_t begin, int32_t end) {
    for (int32_t first = begin; first < end; first += row_lanes) {  // a lane asks for what is to be known of one pair
      const int32_t at = first + lane_;
      pair_ = at < end ? __ldg(s_.pair + at) : -1;
      cell_ = pair_ < 0 ? -1 : __ldg(s_.cell + pair_);
      weight_ = pair_ < 0 ? 0.0f : __ldg(s_.weight + pair_);
#pragma unroll
      for (int k = 0; k < row_lanes; k += under_way)
        if (first + k < end) add(k);
    }
    finish();
  }

 private:
  /// The pairs of some lanes.
  __device__ void add(int first) {
    uint4 word[under_way];
    int slot[under_way];
#pragma unroll
    for (int k = 0; k < under_way; ++k) {
      const int32_t pair = max(__shfl_sync(mask_, pair_, first + k, row_lanes), 0);
      slot[k] = pair % most_slots;
      word[k] = row_word(s_.source, pair / most_slots, lane_);
    }
    const float own[8] = {};
#pragma unroll
    for (int k = 0; k < under_way; ++k) {
      const int32_t cell = __shfl_sync(mask_, cell_, first + k, row_lanes);
      const float weight = __shfl_sync(mask_, weight_, first + k, row_lanes);
      if (cell < 0) break;
      if (cell != current_) {
        finish();
        current_ = cell;
      }
      sums_.add(word[k], own, table_[slot[k]] + 8 * lane_, weight);
    }
  }
  /// Leaves the sums of the cell so far.
  __device__ void finish() {
    if (current_ < 0) return;
    float4* const to = reinterpret_cast<float4*>(s_.sums + (int64_t{current_} + part_) * layer_width + 8 * lane_);
    to[0] = {sums_.activated(0), sums_.activated(1), sums_.activated(2), sums_.activated(3)};
    to[1] = {sums_.activated(4), sums_.activated(5), sums_.activated(6), sums_.activated(7)};
    sums_ = {};
  }

  const PairAggregation& s_;
  const Table& table_;
  int32_t part_;
  int lane_;
  unsigned mask_;
  int32_t pair_ = -1, cell_ = -1, current_ = -1;
  float weight_ = 0;
  MessageAggregation sums_;
};

__global__ void __launch_bounds__(threads) sum_pairs_kernel(PairAggregation s) {
  __shared__ Shared shared;
  const int i = 4 * static_cast<int>(threadIdx.x);
  static_assert(most_slots * layer_width == 4 * threads);
  *reinterpret_cast<float4*>(&shared.table[0][0] + i) = __ldg(reinterpret_cast<const float4*>(s.table + i));
  const int32_t first = s.range[0], cells = s.range[1] - first;
  if ((s.overflow && *s.overflow != 0) || cells > s.most_cells) return;
  __syncthreads();
  const int32_t begin = __ldg(s.begin + first), end = __ldg(s.begin + first + cells);
  const auto part = static_cast<int32_t>(blockIdx.x * half_warps + threadIdx.x / row_lanes);
  const PairParts::Range pairs = s.parts.pairs_of(part);
  const int32_t from = max(pairs.begin, begin), to = min(pairs.end, end);
  if (from < to) PartSums(s, shared.table, part).run(from, to);
}

}  // namespace

void aggregate_pairs(const PairAggregation& sums, int64_t pairs, void* stream) {
  if (pairs == 0) return;
  const int64_t of_further_scenes = sums.parts.pair_begin == nullptr ? 0 : sums.parts.scenes - 1;
  const int64_t parts = (pairs + pairs_a_part - 1) / pairs_a_part + of_further_scenes;
  sum_pairs_kernel<<<static_cast<unsigned>((parts + half_warps - 1) / half_warps), threads, 0,
                     static_cast<cudaStream_t>(stream)>>>(sums);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

}  // namespace graupel::graph
