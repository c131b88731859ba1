// The pressure of a density projection with many cells: all multiprocessors in one launch, which wait for each other
// between the sweeps. A thread keeps a cell of each colour in its registers.
#include <cooperative_groups.h>

#include "graph/cuda/density_list.h"
#include "graph/cuda/launch_together.h"

namespace graupel::graph {

namespace {

using namespace density;

constexpr int block_threads = 512;
using Scan = cub::BlockScan<int32_t, block_threads>;

/// A cell and what is not changed by sweeps.
struct HeldCell {
  int32_t cell = -1;  ///< none
  Equation equation;
  float pressure, lower[3], upper[3];  ///< shares of the faces
};

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
    HeldCell held[2];
#pragma unroll
    for (int color = 0; color < 2; ++color) {
      const int32_t first = begin[color] + thread_;
      if (first < begin[color + 1]) held[color] = taken(first);
      for (int32_t k = first + threads_; k < begin[color + 1]; k += threads_) s_.equation[k] = taken(k).equation;
    }
    for (int sweep = 0; sweep < s_.sweeps; ++sweep)
#pragma unroll
      for (int color = 0; color < 2; ++color) {
        if (held[color].cell >= 0) relax(held[color]);
        for (int32_t k = begin[color] + thread_ + threads_; k < begin[color + 1]; k += threads_) relax_again(k);
        if (color == 0 || sweep + 1 < s_.sweeps) all.sync();
      }
  }

 private:
  /// Active cells of the colours before `color`.
  __device__ int32_t rank_at(int color) const { return __ldcg(s_.rank + color * in_color_); }

  /// Cell number k; its mass is used up.
  __device__ HeldCell taken(int32_t k) {
    HeldCell held;
    held.cell = __ldcg(s_.cell + k);
    const Shares own = s_.shares[held.cell];
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      held.lower[d] = own.face[d];
      held.upper[d] = s_.shares[held.cell + s_.cells.stride(d)].face[d];
    }
    held.pressure = __ldcg(s_.pressure + held.cell);
    held.equation = equation_of(s_.mass[held.cell], own, held.upper);
    s_.mass[held.cell] = 0;
    return held;
  }
  __device__ void relax(HeldCell& held) {
    if (held.equation.inverse_sum == 0) return;
    float below[3], above[3], sum = held.equation.excess;
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      below[d] = __ldcg(s_.pressure + held.cell - s_.cells.stride(d));
      above[d] = __ldcg(s_.pressure + held.cell + s_.cells.stride(d));
    }
#pragma unroll
    for (int d = 0; d < 3; ++d) sum += held.lower[d] * below[d] + held.upper[d] * above[d];
    held.pressure = relaxed(held.pressure, sum, held.equation.inverse_sum, s_.relaxation);
    s_.pressure[held.cell] = held.pressure;
  }
  /// A cell beyond those that threads hold.
  __device__ void relax_again(int32_t k) {
    HeldCell held;
    held.cell = __ldcg(s_.cell + k);
    held.equation = s_.equation[k];
    held.pressure = __ldcg(s_.pressure + held.cell);
    const Shares own = s_.shares[held.cell];
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      held.lower[d] = own.face[d];
      held.upper[d] = s_.shares[held.cell + s_.cells.stride(d)].face[d];
    }
    relax(held);
  }

  const DensitySystem& s_;
  Scan::TempStorage& scan_;
  int32_t thread_, threads_;
  int64_t in_color_;
};

__global__ void __launch_bounds__(block_threads) sweep_kernel(DensitySystem system) {
  __shared__ Scan::TempStorage scan;
  Sweeper(system, scan).run();
}

}  // namespace

void sweep_density(const DensitySystem& system, int64_t capacity, void* stream) {
  const int64_t of_color = (capacity + 1) / 2;
  launch_together(sweep_kernel, (of_color + block_threads - 1) / block_threads, block_threads, 0, system, stream);
}

}  // namespace graupel::graph
