#include "graph/corrections/density_solver.h"

#include "core/parallel/launch_items.cuh"
#include "core/system/error.h"
#include "graph/cuda/corrections/density_list.h"
#include "graph/cuda/corrections/density_sweeps.h"
#include "graph/cuda/launch/block_cluster.h"

namespace graupel::graph {

namespace {

using namespace density;
using namespace cluster;

/// Cells of a colour that one block holds in its registers.
constexpr int cells_a_thread = 4, few_cells = cells_a_thread * block_threads;
constexpr int swept_cells = 2;                         ///< of a colour that a thread holds where there are more
constexpr int64_t most_of_cluster = int64_t{1} << 19;  ///< cells; beyond it all multiprocessors are faster
constexpr int64_t most_words = int64_t{1} << 17;       ///< each of their blocks counts the words before its own

struct Shared {
  cub::BlockScan<int32_t, block_threads>::TempStorage scan;
  float pressure[2 * few_cells + 1];  ///< the last one is 0
};

/// A cell with its neighbours' numbers among the active cells.
struct RegisterCell {
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
    cluster_.sync();
    list_cells<block_threads>(s_, shared_.scan, cluster_.block_rank(), blocks);
    cluster_.sync();
    const int32_t begin = size_of_colors(0), end = size_of_colors(1);
    if (begin <= few_cells && end - begin <= few_cells)
      solve_few(begin, end);
    else
      Sweeps<swept_cells>(s_, thread_, all_threads, {0, begin, end}).run([&] { cluster_.sync(); });
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

  __device__ void upper_faces(int32_t i, float (&upper)[3]) const {
    for (int d = 0; d < 3; ++d) upper[d] = s_.open_fractions[i + s_.cells.stride(d)].face[d];
  }

  __device__ void clear_words() {
    cluster_.sync();
    for (int64_t w = thread_; w < words(); w += all_threads) s_.words[w] = 0;
  }

  // One block, pressures in its shared memory

  __device__ void solve_few(int32_t begin, int32_t end) {
    if (cluster_.block_rank() != 0) return;
    RegisterCell register_cells[2][cells_a_thread];
#pragma unroll
    for (int color = 0; color < 2; ++color)
#pragma unroll
      for (int j = 0; j < cells_a_thread; ++j)
        load_cell(register_cells[color][j], color, number(begin, color, j), color == 0 ? begin : end);
    if (threadIdx.x == 0) shared_.pressure[2 * few_cells] = 0;
    __syncthreads();
    for (int32_t k = static_cast<int32_t>(threadIdx.x); k < end; k += block_threads) s_.mass[__ldcg(s_.cell + k)] = 0;
    for (int sweep = 0; sweep < s_.sweeps; ++sweep)
#pragma unroll
      for (int color = 0; color < 2; ++color) {
#pragma unroll
        for (int j = 0; j < cells_a_thread; ++j) sweep_registers(register_cells[color][j], number(begin, color, j));
        __syncthreads();
      }
    for (int32_t k = static_cast<int32_t>(threadIdx.x); k < end; k += block_threads)
      s_.pressure[__ldcg(s_.cell + k)] = shared_.pressure[k];
  }
  __device__ static int32_t number(int32_t begin, int color, int j) {
    return (color == 0 ? 0 : begin) + static_cast<int32_t>(threadIdx.x) + j * block_threads;
  }
  __device__ void load_cell(RegisterCell& cell, int color, int32_t k, int32_t end) {
    cell.equation.inverse_sum = 0;
    if (k >= end) return;
    const int32_t i = __ldcg(s_.cell + k);
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      const int32_t stride = s_.cells.stride(d);
      cell.neighbor[2 * d] = active_number(1 - color, i - stride);
      cell.neighbor[2 * d + 1] = active_number(1 - color, i + stride);
    }
    const OpenFractions own = s_.open_fractions[i];
    float upper[3];
    upper_faces(i, upper);
    cell.equation = equation_of(__ldcg(s_.mass + i), own, upper);
    shared_.pressure[k] = __ldcg(s_.pressure + i);
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      cell.face[2 * d] = own.face[d];
      cell.face[2 * d + 1] = upper[d];
    }
  }
  /// Number of a cell of a colour; one without pressure where it holds no matter.
  __device__ uint16_t active_number(int color, int32_t i) const {
    const int64_t bit = color * s_.cells.words_of_color() * word_bits + i / 2;
    const uint32_t mask = 1u << (bit % word_bits), word = __ldcg(s_.words + bit / word_bits);
    const int32_t number = __ldcg(s_.rank + bit / word_bits) + grid::ones(word & (mask - 1));
    return static_cast<uint16_t>((word & mask) == 0 ? 2 * few_cells : number);
  }
  __device__ void sweep_registers(const RegisterCell& cell, int32_t k) {
    if (cell.equation.inverse_sum == 0) return;
    float sum = cell.equation.excess;
#pragma unroll
    for (int d = 0; d < 3; ++d)
      sum += cell.face[2 * d] * shared_.pressure[cell.neighbor[2 * d]] +
             cell.face[2 * d + 1] * shared_.pressure[cell.neighbor[2 * d + 1]];
    shared_.pressure[k] = relaxed(shared_.pressure[k], sum, cell.equation.inverse_sum, s_.relaxation);
  }

  const DensitySystem& s_;
  Shared& shared_;
  Group cluster_;
  int thread_;
};

template <typename Items>
__global__ void __launch_bounds__(block_threads) solve_kernel(const __grid_constant__ Items items) {
  const DensitySystem& system = items.own();
  __shared__ Shared shared;
  if (!system.is_skipped()) Solver(system, shared).run();
}

}  // namespace

static bool suits_a_cluster(int64_t capacity, int64_t words) {
  static const bool can = can_launch(solve_kernel<LaunchItems<DensitySystem, 1>>);
  return can && capacity <= most_of_cluster && words <= most_words / 4;
}

bool solves_density_at_once(int64_t capacity, int64_t words) {
  return suits_a_cluster(capacity, words) || words <= most_words;
}

void solve_density(const std::vector<DensitySystem>& systems, void* stream) {
  std::vector<DensitySystem> of_clusters;
  for (const DensitySystem& system : systems)
    if (suits_a_cluster(system.capacity, 2 * system.cells.words_of_color()))
      of_clusters.push_back(system);
    else
      sweep_density(system, stream);
  launch_items(of_clusters, [&](const auto& items, unsigned count) {
    const auto kernel = solve_kernel<std::decay_t<decltype(items)>>;
    static const bool can = can_launch(kernel);
    GRAUPEL_ASSERT(can);
    launch(kernel, items, stream, count);
  });
}

}  // namespace graupel::graph
