// A cluster of sixteen blocks as one group of threads, and its launch (compute capability 9.0).
#pragma once

#include <cooperative_groups.h>

#include <cstdint>

#include "core/parallel/cuda_check.h"

namespace graupel::graph::cluster {

namespace groups = cooperative_groups;

constexpr int blocks = 16, block_threads = 512, all_threads = blocks * block_threads;

/// The cluster of the calling block. Kernels are compiled for older GPUs too, which can_launch() keeps them from.
struct Group {
#if !defined(__CUDA_ARCH__) || __CUDA_ARCH__ >= 900
  __device__ unsigned block_rank() const { return groups::this_cluster().block_rank(); }
  __device__ void sync() const { groups::this_cluster().sync(); }
#else
  __device__ unsigned block_rank() const { return 0; }
  __device__ void sync() const {}
#endif
};

__device__ inline int thread_of(const Group& cluster) {
  return static_cast<int>(cluster.block_rank()) * block_threads + static_cast<int>(threadIdx.x);
}

/// Of `clusters` clusters, one a row of blocks.
inline cudaLaunchConfig_t launch_config(cudaLaunchAttribute& attribute, void* stream, unsigned clusters = 1) {
  attribute.id = cudaLaunchAttributeClusterDimension;
  attribute.val.clusterDim.x = blocks;
  attribute.val.clusterDim.y = attribute.val.clusterDim.z = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(blocks, clusters);
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
void launch(Kernel kernel, const Argument& argument, void* stream, unsigned clusters = 1) {
  cudaLaunchAttribute attribute{};
  const cudaLaunchConfig_t config = launch_config(attribute, stream, clusters);
  GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&config, kernel, argument));
}

}  // namespace graupel::graph::cluster
