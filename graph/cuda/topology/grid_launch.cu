#include "graph/topology/grid_launch.h"

#include <cooperative_groups.h>

#include <algorithm>
#include <cub/block/block_scan.cuh>

#include "graph/cuda/launch/launch_together.h"

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

/// The calling thread's block.
class Block {
 public:
  template <typename T>
  struct PerThread {
    T own{};
    __device__ T& operator[](int) { return own; }
  };

  __device__ explicit Block(Shared& shared)
      : word(shared.word), cells(shared.cells), pairs(shared.pairs), scan_(shared.scan) {}
  __device__ int64_t index() const { return blockIdx.x; }
  __device__ int64_t count() const { return gridDim.x; }
  __device__ static constexpr int threads() { return block_threads; }
  __device__ static void wait() { __syncthreads(); }
  template <typename Body>
  __device__ void for_threads(const Body& body) const {
    body(static_cast<int>(threadIdx.x));
  }
  __device__ int32_t sum_before(PerThread<int32_t>& value) {
    int32_t total = 0;
    Scan(scan_).ExclusiveSum(value.own, value.own, total);
    wait();
    return total;
  }
  /// A warp a word, a lane a bit.
  template <typename Used, typename Of, typename Body>
  __device__ void for_bits(int64_t first, int64_t last, const Used& used, const Of& of, const Body& body) const {
    const int lane = static_cast<int>(threadIdx.x) % word_bits;
    for (int64_t w = first + threadIdx.x / word_bits; w < last; w += warps)
      if (used(w)) body(w, lane, sum_of_lanes_before(of(w, lane), lane));
  }

  uint32_t* const word;
  int32_t *const cells, *const pairs;

 private:
  Scan::TempStorage& scan_;
};

__global__ void __launch_bounds__(block_threads) build_kernel(GridProgram program) {
  __shared__ Shared shared;
  Block block(shared);
  BuildAtOnce<Block> build(program, block);
  const auto all = cooperative_groups::this_grid();
  build.mark_cells();
  all.sync();
  build.number_cells();
  all.sync();
  build.link_cells();
  all.sync();
  build.order_pairs();
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
