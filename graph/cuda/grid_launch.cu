#include "graph/cuda/grid_launch.h"

#include <cooperative_groups.h>

#include <algorithm>
#include <cub/block/block_scan.cuh>

#include "graph/cuda/launch_together.h"

namespace graupel::graph {

namespace {

using namespace grid;

constexpr int block_threads = 512, warps = block_threads / word_bits;
constexpr int most_scenes = 4;

using Scan = cub::BlockScan<int32_t, block_threads>;

/// What a block keeps of its words.
struct Shared {
  Scan::TempStorage scan;
  uint32_t word[block_threads];
  int32_t cells[block_threads], pairs[block_threads];  ///< before each word
};

/// The sum of the values of all threads of the block before this one, and of all.
__device__ int32_t sum_before(Shared& shared, int32_t value, int32_t& total) {
  int32_t before = 0;
  Scan(shared.scan).ExclusiveSum(value, before, total);
  __syncthreads();
  return before;
}

/// The sum of the values of all lanes before this one.
__device__ int32_t sum_of_lanes_before(int32_t value, int lane) {
  int32_t sum = value;
#pragma unroll
  for (int way = 1; way < word_bits; way *= 2) {
    const int32_t other = __shfl_up_sync(0xffffffffu, sum, way);
    if (lane >= way) sum += other;
  }
  return sum - value;
}

class Builder {
 public:
  __device__ Builder(const GridProgram& program, Shared& shared)
      : p_(program),
        k_(program.link.k),
        shared_(shared),
        thread_(int64_t{blockIdx.x} * block_threads + threadIdx.x),
        threads_(int64_t{gridDim.x} * block_threads) {}

  __device__ void run() {
    const auto all = cooperative_groups::this_grid();
    const int64_t pairs = corners * p_.particles;
    for (int64_t i = thread_; i < pairs; i += threads_) mark(i);
    all.sync();
    number_cells();
    all.sync();
    const int64_t links = int64_t{link_slots} * __ldcg(p_.link.level_begin + k_.levels);
    for (int64_t i = thread_; i < links + pairs; i += threads_) i < links ? link(i) : list(i - links);
    all.sync();
    const OrderPairs order{p_.cell, p_.pair_begin, p_.listed, p_.pair};
    for (int64_t i = thread_; i < pairs; i += threads_) order(i);
    if (p_.link.count)
      for (int64_t i = thread_; i < links / link_slots; i += threads_)
        p_.link.count[i] = p_.link.count_of(static_cast<int32_t>(i), p_.link.cell_box[i]);
    clear();
  }

 private:
  static constexpr int link_slots = LinkCell::slots + 1;  ///< items a cell

  /// Counts pair i in its cell; the first one marks the cell and its ancestors.
  __device__ void mark(int64_t i) {
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
    for (int l = 0; place == 0 && l < k_.levels; ++l, cell = coarser(cell)) {
      const int64_t own = bit_of(k_.box[l * k_.scenes + scene], cell);
      atomicOr(k_.words + own / word_bits, 1u << (own % word_bits));
    }
  }

  /// Numbers of the cells and of the first pair of each, by blocks of neighbouring words. Each block adds up by itself
  /// what lies before its own.
  __device__ void number_cells() {
    const int64_t each = (p_.words + gridDim.x - 1) / gridDim.x, first = blockIdx.x * each;
    const int64_t last = std::min(first + each, p_.words);
    if (first >= last) return;
    int32_t cells = 0, pairs = 0, cells_before = 0, pairs_before = 0, all = 0;
    for (int64_t w = threadIdx.x; w < first; w += block_threads) {
      cells += ones(__ldcg(k_.words + w));
      if (w < p_.fine_words) pairs += __ldcg(p_.word_pairs + w);
    }
    sum_before(shared_, cells, cells_before);
    sum_before(shared_, pairs, pairs_before);
    const int64_t own = first + threadIdx.x;
    const uint32_t word = own < last ? __ldcg(k_.words + own) : 0;
    const int32_t in_word = own < last && own < p_.fine_words ? __ldcg(p_.word_pairs + own) : 0;
    cells = cells_before + sum_before(shared_, ones(word), all);
    pairs = pairs_before + sum_before(shared_, in_word, all);
    shared_.word[threadIdx.x] = word;
    shared_.cells[threadIdx.x] = cells;
    shared_.pairs[threadIdx.x] = pairs;
    if (own < last) p_.rank[own] = cells;
    if (own < last && own == p_.words - 1) p_.link.level_begin[k_.levels] = cells + ones(word);
    if (own < last && own == p_.fine_words - 1)
      p_.pair_begin[cells + ones(word)] = static_cast<int32_t>(corners * p_.particles);
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < k_.levels) {
      const int64_t w = k_.word_begin[threadIdx.x * k_.scenes];
      if (w >= first && w < last) p_.link.level_begin[threadIdx.x] = shared_.cells[w - first];
    }
    for (int64_t w = first + threadIdx.x / word_bits; w < last; w += warps)
      describe_cells(w, static_cast<int>(w - first));
  }

  /// A warp's word, a lane a bit.
  __device__ void describe_cells(int64_t w, int place) {
    const int lane = static_cast<int>(threadIdx.x) % word_bits;
    const uint32_t word = shared_.word[place];
    if (word == 0) return;
    const int32_t pairs = w < p_.fine_words ? __ldcg(p_.bit_pairs + w * word_bits + lane) : 0;
    const int32_t before = shared_.pairs[place] + sum_of_lanes_before(pairs, lane);
    if ((word >> lane & 1) == 0) return;
    const int32_t number = shared_.cells[place] + ones(word & ((1u << lane) - 1));
    if (w < p_.fine_words) p_.pair_begin[number] = before;
    const int b = range_of(k_.word_begin, k_.boxes(), w);
    p_.link.describe(number, b, GridCells::coordinate_of(k_.box[b], w, lane));
  }

  __device__ void link(int64_t i) {
    const auto cell = static_cast<int32_t>(i / link_slots);
    const int slot = static_cast<int>(i % link_slots);
    if (slot < LinkCell::slots) p_.link.link_slot(cell, p_.link.cell_box[cell], p_.link.coordinate[cell], slot);
  }

  __device__ void list(int64_t i) {
    const int32_t bit = p_.cell[i];
    const uint32_t below = (1u << (bit % word_bits)) - 1;
    const int32_t number = k_.rank[bit / word_bits] + ones(k_.words[bit / word_bits] & below);
    p_.cell[i] = number;
    p_.listed[p_.pair_begin[number] + p_.place[i]] = static_cast<int32_t>(i);
  }

  __device__ void clear() {
    for (int64_t i = thread_; i < p_.words; i += threads_) k_.words[i] = 0;
    for (int64_t i = thread_; i < p_.fine_words; i += threads_) p_.word_pairs[i] = 0;
    int4* const quads = reinterpret_cast<int4*>(p_.bit_pairs);
    for (int64_t i = thread_; i < p_.fine_words * (word_bits / 4); i += threads_) quads[i] = {0, 0, 0, 0};
    if (thread_ == 0) {
      *p_.overflow = *p_.outside;
      *p_.outside = 0;
    }
  }

  const GridProgram& p_;
  const GridCells& k_;
  Shared& shared_;
  int64_t thread_, threads_;
};

__global__ void __launch_bounds__(block_threads) build_kernel(GridProgram program) {
  __shared__ Shared shared;
  Builder(program, shared).run();
}

}  // namespace

bool builds_grid_at_once(int scenes, int64_t words) {
  return scenes <= most_scenes && words <= block_threads * multiprocessors();
}

void build_grid(const GridProgram& program, void* stream) {
  const int64_t items = std::max(corners * program.particles, program.words);
  launch_together(build_kernel, (items + block_threads - 1) / block_threads, block_threads, 0, program, stream);
}

}  // namespace graupel::graph
