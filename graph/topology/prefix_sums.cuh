// Running sums of up to a million values in one launch: each block adds what stands before its own values by itself.
#pragma once

#include <cstdint>
#include <cub/block/block_reduce.cuh>
#include <cub/block/block_scan.cuh>
#include <cuda/std/functional>

#include "core/parallel/cuda_check.h"

namespace graupel::graph {

constexpr int scan_threads = 512, scan_items = 8, scan_block = scan_threads * scan_items;
constexpr int64_t most_in_one_launch = int64_t{1} << 20;

template <typename T, typename From, typename Value>
__global__ void __launch_bounds__(scan_threads)
    prefix_sums_kernel(int64_t n, const int32_t* present, const From* from, Value value, T* sums) {
  using Reduce = cub::BlockReduce<T, scan_threads>;
  using Scan = cub::BlockScan<T, scan_threads>;
  __shared__ union {
    typename Reduce::TempStorage reduce;
    typename Scan::TempStorage scan;
  } shared;
  __shared__ T before;
  if (present) n = *present;
  const int64_t first = int64_t{blockIdx.x} * scan_block;
  if (first > n) return;
  T sum{};
  for (int64_t i = threadIdx.x; i < first; i += scan_threads) sum = sum + value(from[i]);
  sum = Reduce(shared.reduce).Reduce(sum, cuda::std::plus<>{});
  if (threadIdx.x == 0) before = sum;
  __syncthreads();
  T own[scan_items];
  const int64_t place = first + int64_t{threadIdx.x} * scan_items;
#pragma unroll
  for (int k = 0; k < scan_items; ++k) own[k] = place + k < n ? value(from[place + k]) : T{};
  Scan(shared.scan).ExclusiveScan(own, own, T{}, cuda::std::plus<>{});
#pragma unroll
  for (int k = 0; k < scan_items; ++k)
    if (place + k <= n) sums[place + k] = before + own[k];
}

/// sums[i] = value(from[0]) + .. + value(from[i - 1]), i <= n, or i <= *present where given.
template <typename T, typename From, typename Value>
void launch_prefix_sums(int64_t n, const int32_t* present, const From* from, Value value, T* sums,
                        cudaStream_t stream) {
  const auto blocks = static_cast<unsigned>(n / scan_block + 1);
  prefix_sums_kernel<<<blocks, scan_threads, 0, stream>>>(n, present, from, value, sums);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

}  // namespace graupel::graph
