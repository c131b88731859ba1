// A cluster of sixteen blocks as one group of threads: running sums over it, and its launch (compute capability 9.0).
#pragma once

#include <cooperative_groups.h>

#include <cstdint>
#include <cub/block/block_scan.cuh>

#include "core/cuda_check.h"

namespace graupel::graph::cluster {

namespace groups = cooperative_groups;

constexpr int blocks = 16, block_threads = 512, all_threads = blocks * block_threads;

using Scan = cub::BlockScan<int32_t, block_threads>;

struct ScanMemory {
  Scan::TempStorage scan;
  int32_t total;
};

__device__ inline int thread_of(const groups::cluster_group& cluster) {
  return static_cast<int>(cluster.block_rank()) * block_threads + static_cast<int>(threadIdx.x);
}

/// The sum of the counts of all threads before this one. Synchronizes the cluster; another call, or the end of a block,
/// needs one more in between.
__device__ inline int32_t sum_before(const groups::cluster_group& cluster, ScanMemory& memory, int32_t count) {
  int32_t before = 0, total = 0;
  Scan(memory.scan).ExclusiveSum(count, before, total);
  if (threadIdx.x == 0) memory.total = total;
  cluster.sync();
  for (unsigned block = 0; block < cluster.block_rank(); ++block)
    before += *cluster.map_shared_rank(&memory.total, block);
  return before;
}

inline cudaLaunchConfig_t launch_config(cudaLaunchAttribute& attribute, void* stream) {
  attribute.id = cudaLaunchAttributeClusterDimension;
  attribute.val.clusterDim.x = blocks;
  attribute.val.clusterDim.y = attribute.val.clusterDim.z = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(blocks);
  config.blockDim = dim3(block_threads);
  config.stream = static_cast<cudaStream_t>(stream);
  config.attrs = &attribute;
  config.numAttrs = 1;
  return config;
}

/// Whether this GPU runs a kernel so. Sixteen blocks are more than every GPU with clusters has to allow.
template <typename Kernel>
bool can_launch(Kernel kernel) {
  cudaLaunchAttribute attribute{};
  const cudaLaunchConfig_t config = launch_config(attribute, nullptr);
  int clusters = 0;
  const bool can = cudaFuncSetAttribute(kernel, cudaFuncAttributeNonPortableClusterSizeAllowed, 1) == cudaSuccess &&
                   cudaOccupancyMaxActiveClusters(&clusters, kernel, &config) == cudaSuccess && clusters > 0;
  static_cast<void>(cudaGetLastError());
  return can;
}

template <typename Kernel, typename Argument>
void launch(Kernel kernel, const Argument& argument, void* stream) {
  cudaLaunchAttribute attribute{};
  const cudaLaunchConfig_t config = launch_config(attribute, stream);
  GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&config, kernel, argument));
}

}  // namespace graupel::graph::cluster
