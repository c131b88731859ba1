// Runs the kernels of a BatchSolver on a GPU: one stream, a CUDA graph for each segment, CUB for sort and selection.
#pragma once

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include <algorithm>

#include "core/buffer.h"
#include "core/cuda_check.h"
#include "mpm/batch_kernels.h"

namespace graupel::mpm {

namespace kernels {

template <typename Body>
__global__ void items(int64_t n, Body body) {
  const int64_t i = static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < n) body(i);
}
static __global__ void __launch_bounds__(batch::block_threads) particle_to_grid(BatchView view) {
  __shared__ batch::ScatterShared shared;
  batch::particle_to_grid(CudaBlock{}, view, shared);
}
static __global__ void __launch_bounds__(256) update_grid(BatchView view) {
  batch::update_node(view, static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x);
}
static __global__ void __launch_bounds__(batch::block_threads) grid_to_particle(BatchView view) {
  __shared__ batch::GatherShared shared;
  batch::grid_to_particle(CudaBlock{}, view, shared);
}

}  // namespace kernels

class CudaBackend {
 public:
  using Atomics = CudaBlock;

  CudaBackend() { GRAUPEL_CUDA_CHECK(cudaStreamCreate(&stream_)); }
  ~CudaBackend() {
    forget();
    cudaStreamDestroy(stream_);
  }
  CudaBackend(const CudaBackend&) = delete;
  CudaBackend& operator=(const CudaBackend&) = delete;

  Device device() const { return Device::cuda; }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream_)); }

  /// Storage for sorting `particles` pairs and selecting among `keys` marks.
  void reserve(int64_t particles, int64_t keys) {
    std::size_t sort = 0, select = 0;
    const auto n = static_cast<int>(particles), most = static_cast<int>(std::max(particles, keys));
    GRAUPEL_CUDA_CHECK(cub::DeviceRadixSort::SortPairs(
        nullptr, sort, static_cast<const uint32_t*>(nullptr), static_cast<uint32_t*>(nullptr),
        static_cast<const int32_t*>(nullptr), static_cast<int32_t*>(nullptr), n));
    GRAUPEL_CUDA_CHECK(cub::DeviceSelect::Flagged(nullptr, select, thrust::counting_iterator<int32_t>(0),
                                                  static_cast<const uint8_t*>(nullptr), static_cast<int32_t*>(nullptr),
                                                  static_cast<int32_t*>(nullptr), most));
    scratch_ = Buffer<uint8_t>(Device::cuda, std::max(sort, select));
    forget();
  }

  /// Runs what `record` launches; from the second time on as a graph, until forget().
  template <typename Record>
  void segment(const Record& record) {
    if (graph_ == nullptr) {
      cudaGraph_t captured;
      GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
      record();
      GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream_, &captured));
      GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph_, captured, 0));
      GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
    }
    GRAUPEL_CUDA_CHECK(cudaGraphLaunch(graph_, stream_));
  }
  /// Storage has moved: the next segment is recorded anew.
  void forget() {
    if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }

  template <typename Body>
  void launch(int64_t n, const Body& body) {
    constexpr int threads = 128;
    if (n <= 0) return;
    kernels::items<<<static_cast<unsigned>((n + threads - 1) / threads), threads, 0, stream_>>>(n, body);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void fill(void* data, int value, std::size_t bytes) {
    GRAUPEL_CUDA_CHECK(cudaMemsetAsync(data, value, bytes, stream_));
  }
  /// Stable. Keys are below `keys`.
  void sort_pairs(const uint32_t* key, uint32_t* sorted_key, const int32_t* value, int32_t* sorted_value, int64_t n,
                  uint64_t keys) {
    int bits = 1;
    while (bits < 32 && (uint64_t{1} << bits) < keys) ++bits;
    std::size_t bytes = scratch_.size();
    GRAUPEL_CUDA_CHECK(cub::DeviceRadixSort::SortPairs(scratch_.data(), bytes, key, sorted_key, value, sorted_value,
                                                       static_cast<int>(n), 0, bits, stream_));
  }
  /// Numbers of the marked items, ascending, and how many they are (both on the device).
  void select_marked(const uint8_t* marked, int64_t n, int32_t* selected, int32_t* count) {
    std::size_t bytes = scratch_.size();
    GRAUPEL_CUDA_CHECK(cub::DeviceSelect::Flagged(scratch_.data(), bytes, thrust::counting_iterator<int32_t>(0), marked,
                                                  selected, count, static_cast<int>(n), stream_));
  }

  void particle_to_grid(const BatchView& view) {
    kernels::particle_to_grid<<<static_cast<unsigned>(view.home_capacity), batch::block_threads, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void update_grid(const BatchView& view) {
    const int64_t nodes = int64_t(view.node_capacity) * nodes_per_block<3>;
    kernels::update_grid<<<static_cast<unsigned>((nodes + 255) / 256), 256, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void grid_to_particle(const BatchView& view) {
    kernels::grid_to_particle<<<static_cast<unsigned>(view.home_capacity), batch::block_threads, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }

 private:
  cudaStream_t stream_ = nullptr;
  cudaGraphExec_t graph_ = nullptr;
  Buffer<uint8_t> scratch_;
};

}  // namespace graupel::mpm
