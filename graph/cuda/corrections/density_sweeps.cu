// The pressure of a density projection with many cells: all multiprocessors in one launch, which wait for each other
// between the sweeps.
#include <cooperative_groups.h>

#include "graph/cuda/corrections/density_list.h"
#include "graph/cuda/corrections/density_sweeps.h"
#include "graph/cuda/launch/launch_together.h"

namespace graupel::graph {

namespace {

using namespace density;

constexpr int block_threads = 512;
using Scan = cub::BlockScan<int32_t, block_threads>;

class Sweeper {
 public:
  __device__ Sweeper(const DensitySystem& system, Scan::TempStorage& scan)
      : s_(system),
        scan_(scan),
        thread_(static_cast<int32_t>(blockIdx.x * block_threads + threadIdx.x)),
        threads_(static_cast<int32_t>(gridDim.x * block_threads)),
        in_color_(s_.cells.words_of_color()) {}

  __device__ void run() {
    const auto all = cooperative_groups::this_grid();
    const int32_t last = rank_at(2);
    for (int32_t k = thread_; k < last; k += threads_) {
      const int32_t i = __ldcg(s_.cell + k);
      if (s_.mass[i] == 0) s_.pressure[i] = 0;
    }
    all.sync();
    list_cells<block_threads>(s_, scan_, blockIdx.x, gridDim.x);
    all.sync();
    for (int64_t w = thread_; w < 2 * in_color_; w += threads_) s_.words[w] = 0;
    const int32_t begin[3] = {0, rank_at(1), rank_at(2)};
    Sweeps<1>(s_, thread_, threads_, begin).run([&] { all.sync(); });
  }

 private:
  /// Active cells of the colours before `color`.
  __device__ int32_t rank_at(int color) const { return __ldcg(s_.rank + color * in_color_); }

  const DensitySystem& s_;
  Scan::TempStorage& scan_;
  int32_t thread_, threads_;
  int64_t in_color_;
};

__global__ void __launch_bounds__(block_threads) sweep_kernel(DensitySystem system) {
  __shared__ Scan::TempStorage scan;
  if (!system.is_skipped()) Sweeper(system, scan).run();
}

}  // namespace

void sweep_density(const DensitySystem& system, void* stream) {
  const int64_t of_color = (system.capacity + 1) / 2;
  launch_together(sweep_kernel, (of_color + block_threads - 1) / block_threads, block_threads, 0, system, stream);
}

}  // namespace graupel::graph
