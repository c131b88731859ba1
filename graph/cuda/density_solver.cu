#include "graph/cuda/density_solver.h"

#include "graph/cuda/block_cluster.h"

namespace graupel::graph {

namespace {

using namespace density;
using namespace cluster;

/// Cells of a colour that one block holds in its registers.
constexpr int cells_a_thread = 4, few_cells = cells_a_thread * block_threads;
constexpr int64_t most_of_cluster = int64_t{1} << 18;  ///< cells; beyond it all multiprocessors are faster
constexpr int64_t most_words = int64_t{1} << 17;       ///< each of their blocks counts the words before its own

struct Shared {
  ScanMemory scan;
  float pressure[2 * few_cells + 1];  ///< the last one is 0
};

/// A cell with its neighbours' numbers among the active cells.
struct HeldCell {
  Equation equation;
  float face[6];
  uint16_t neighbor[6];
};

class Solver {
 public:
  __device__ Solver(const DensitySystem& system, Shared& shared)
      : s_(system), shared_(shared), thread_(thread_of(cluster_)) {}

  __device__ void run() {
    drop_pressure();
    list_cells();
    const int32_t begin = size_of_colors(0), end = size_of_colors(1);
    if (begin <= few_cells && end - begin <= few_cells)
      solve_few(begin, end);
    else
      solve_many(begin, end);
    clear_words();
  }

 private:
  __device__ int64_t words() const { return 2 * s_.cells.words_of_color(); }
  /// Active cells of the colours up to `color`.
  __device__ int32_t size_of_colors(int color) const {
    return __ldcg(s_.rank + (color + 1) * s_.cells.words_of_color());
  }

  __device__ void drop_pressure() {
    const int32_t last = size_of_colors(1);
    for (int32_t k = thread_; k < last; k += all_threads) {
      const int32_t i = __ldcg(s_.cell + k);
      if (__ldcg(s_.mass + i) == 0) s_.pressure[i] = 0;
    }
  }

  /// Numbers the bits of the words, some neighbouring words a thread.
  __device__ void list_cells() {
    const int64_t each = (words() + all_threads - 1) / all_threads, first = thread_ * each;
    const int64_t last = first + each < words() ? first + each : words();
    int32_t count = 0;
    for (int64_t w = first; w < last; ++w) count += grid::ones(__ldcg(s_.words + w));
    int32_t before = sum_before(cluster_, shared_.scan, count);
    for (int64_t w = first; w < last; ++w) {
      s_.rank[w] = before;
      const int color = w >= s_.cells.words_of_color();
      const int64_t bit = (w - color * s_.cells.words_of_color()) * word_bits;
      for (uint32_t left = __ldcg(s_.words + w); left != 0; left &= left - 1, ++before)
        s_.cell[before] = s_.cells.cell_of_bit(color, bit + lowest_one(left));
    }
    if (first < last && last == words()) s_.rank[last] = before;
    cluster_.sync();
  }

  __device__ Equation take_equation(int32_t i, const Shares& own, const float (&upper)[3]) {
    const Equation e = equation_of(__ldcg(s_.mass + i), own, upper);
    s_.mass[i] = 0;
    return e;
  }
  __device__ void upper_faces(int32_t i, float (&upper)[3]) const {
    for (int d = 0; d < 3; ++d) upper[d] = s_.shares[i + s_.cells.stride(d)].face[d];
  }

  __device__ void clear_words() {
    cluster_.sync();
    for (int64_t w = thread_; w < words(); w += all_threads) s_.words[w] = 0;
  }

  // All blocks, pressures in the GPU's memory

  __device__ void solve_many(int32_t begin, int32_t end) {
    for (int32_t k = thread_; k < end; k += all_threads) {
      const int32_t i = __ldcg(s_.cell + k);
      float upper[3];
      upper_faces(i, upper);
      s_.equation[k] = take_equation(i, s_.shares[i], upper);
    }
    cluster_.sync();
    for (int sweep = 0; sweep < 2 * s_.sweeps; ++sweep) {
      const int32_t first = sweep % 2 == 0 ? 0 : begin, last = sweep % 2 == 0 ? begin : end;
      for (int32_t k = first + thread_; k < last; k += all_threads) sweep_cell(k);
      cluster_.sync();
    }
  }
  __device__ void sweep_cell(int32_t k) {
    const float2 both = __ldcg(reinterpret_cast<const float2*>(s_.equation) + k);
    const Equation e{both.x, both.y};
    if (e.inverse_sum == 0) return;
    const int32_t i = __ldcg(s_.cell + k);
    const Shares own = s_.shares[i];
    float sum = e.excess;
    for (int d = 0; d < 3; ++d) {
      const int32_t stride = s_.cells.stride(d);
      sum += own.face[d] * __ldcg(s_.pressure + i - stride) +
             s_.shares[i + stride].face[d] * __ldcg(s_.pressure + i + stride);
    }
    const float before = __ldcg(s_.pressure + i);
    s_.pressure[i] = relaxed(before, sum, e.inverse_sum, s_.relaxation);
  }

  // One block, pressures in its shared memory

  __device__ void solve_few(int32_t begin, int32_t end) {
    if (cluster_.block_rank() != 0) return;
    HeldCell held[2][cells_a_thread];
#pragma unroll
    for (int color = 0; color < 2; ++color)
#pragma unroll
      for (int j = 0; j < cells_a_thread; ++j) hold(held[color][j], number(begin, color, j), color == 0 ? begin : end);
    if (threadIdx.x == 0) shared_.pressure[2 * few_cells] = 0;
    __syncthreads();
    for (int sweep = 0; sweep < s_.sweeps; ++sweep)
#pragma unroll
      for (int color = 0; color < 2; ++color) {
#pragma unroll
        for (int j = 0; j < cells_a_thread; ++j) sweep_held(held[color][j], number(begin, color, j));
        __syncthreads();
      }
    for (int32_t k = static_cast<int32_t>(threadIdx.x); k < end; k += block_threads)
      s_.pressure[__ldcg(s_.cell + k)] = shared_.pressure[k];
  }
  __device__ static int32_t number(int32_t begin, int color, int j) {
    return (color == 0 ? 0 : begin) + static_cast<int32_t>(threadIdx.x) + j * block_threads;
  }
  __device__ void hold(HeldCell& held, int32_t k, int32_t end) {
    held.equation.inverse_sum = 0;
    if (k >= end) return;
    const int32_t i = __ldcg(s_.cell + k);
    const Shares own = s_.shares[i];
    float upper[3];
    upper_faces(i, upper);
    held.equation = take_equation(i, own, upper);
    shared_.pressure[k] = __ldcg(s_.pressure + i);
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      const int32_t stride = s_.cells.stride(d);
      held.face[2 * d] = own.face[d];
      held.face[2 * d + 1] = upper[d];
      held.neighbor[2 * d] = active_number(i, i - stride);
      held.neighbor[2 * d + 1] = active_number(i, i + stride);
    }
  }
  /// Of a cell next to `own`, thus of the other colour.
  __device__ uint16_t active_number(int32_t own, int32_t i) const {
    const int own_color = color_of(own);
    const int64_t bit = (1 - own_color) * s_.cells.words_of_color() * word_bits + i / 2;
    const uint32_t word = __ldcg(s_.words + bit / word_bits), mask = 1u << (bit % word_bits);
    if ((word & mask) == 0) return 2 * few_cells;
    return static_cast<uint16_t>(__ldcg(s_.rank + bit / word_bits) + grid::ones(word & (mask - 1)));
  }
  __device__ int color_of(int32_t i) const {
    const int32_t row = i / s_.cells.size[0];
    return (i % s_.cells.size[0] + row % s_.cells.size[1] + row / s_.cells.size[1]) & 1;
  }
  __device__ void sweep_held(const HeldCell& held, int32_t k) {
    if (held.equation.inverse_sum == 0) return;
    float sum = held.equation.excess;
#pragma unroll
    for (int d = 0; d < 3; ++d)
      sum += held.face[2 * d] * shared_.pressure[held.neighbor[2 * d]] +
             held.face[2 * d + 1] * shared_.pressure[held.neighbor[2 * d + 1]];
    shared_.pressure[k] = relaxed(shared_.pressure[k], sum, held.equation.inverse_sum, s_.relaxation);
  }

  const DensitySystem& s_;
  Shared& shared_;
  Group cluster_;
  int thread_;
};

__global__ void __launch_bounds__(block_threads) solve_kernel(DensitySystem system) {
  __shared__ Shared shared;
  Solver(system, shared).run();
}

}  // namespace

static bool suits_a_cluster(int64_t capacity) {
  static const bool can = can_launch(solve_kernel);
  return can && capacity <= most_of_cluster;
}

bool solves_density_at_once(int64_t capacity, int64_t words) {
  return suits_a_cluster(capacity) || words <= most_words;
}

void solve_density(const DensitySystem& system, int64_t capacity, void* stream) {
  suits_a_cluster(capacity) ? launch(solve_kernel, system, stream) : sweep_density(system, capacity, stream);
}

}  // namespace graupel::graph
