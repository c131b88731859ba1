// Runs the kernels of a BatchSolver on a GPU: one stream, a CUDA graph for each segment, CUB for sort and selection.
#pragma once

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include <algorithm>
#include <cstring>
#include <map>

#include "core/parallel/buffer.h"
#include "core/parallel/cuda_check.h"
#include "mpm/gpu/blocks/batch_list_owners.h"
#include "mpm/gpu/blocks/batch_resident.h"
#include "mpm/gpu/small/small_scene_step.h"

namespace graupel::mpm {

namespace kernels {

template <typename Body>
__global__ void items(int64_t n, Body body) {
  const int64_t i = static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < n) body(i);
}
static __global__ void __launch_bounds__(batch::block_threads, 5) particle_to_grid(BatchView view) {
  __shared__ batch::ScatterShared<batch::block_warps> shared;
  batch::particle_to_grid(CudaBlock{}, view, shared);
}
static __global__ void __launch_bounds__(256) update_grid(BatchView view) {
  batch::update_node(view, static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x);
}
static __global__ void __launch_bounds__(batch::block_threads, 4) grid_to_particle(BatchView view) {
  __shared__ batch::GatherShared shared;
  batch::grid_to_particle(CudaBlock{}, view, shared);
}
static __global__ void __launch_bounds__(batch::list_threads) list_owners(BatchView view) {
  __shared__ batch::ListShared shared;
  batch::list_owners(CudaBlock{}, view, shared);
}
static __global__ void __launch_bounds__(batch::resident_threads, 2) run_segment(BatchView view) {
  extern __shared__ __align__(16) unsigned char shared[];
  batch::run_segment(CudaBlock{}, view, *reinterpret_cast<batch::ResidentShared*>(shared));
}

/// Alone on a multiprocessor, a block has registers for everything; two hide more of each other's waiting.
template <int BlocksAtOnce, typename View>
__global__ void __launch_bounds__(small::threads, BlocksAtOnce) run_frame(View view) {
  __shared__ small::SharedFor<View> shared;
  small::run_frame(CudaBlock{}, view, shared);
}

}  // namespace kernels

class CudaBackend {
 public:
  using Atomics = CudaBlock;

  CudaBackend() {
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&stream_));
    constexpr int shared = sizeof(batch::ResidentShared);
    int device = 0, processors = 0, blocks = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device));
    processors_ = processors;
    if (cudaFuncSetAttribute(kernels::run_segment, cudaFuncAttributeMaxDynamicSharedMemorySize, shared) !=
        cudaSuccess) {
      cudaGetLastError();  // too much for this GPU: no segment in one kernel
      return;
    }
    GRAUPEL_CUDA_CHECK(
        cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, kernels::run_segment, batch::resident_threads, shared));
    resident_blocks_ = blocks * processors;
  }
  ~CudaBackend() {
    forget();
    cudaFreeHost(pinned_);
    cudaStreamDestroy(stream_);
  }
  CudaBackend(const CudaBackend&) = delete;
  CudaBackend& operator=(const CudaBackend&) = delete;

  Device device() const { return Device::cuda; }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream_)); }

  /// Copies n and m records to the host after all that was launched, and waits for them.
  template <typename A, typename B>
  void read(const A* a, std::size_t n, A* to_a, const B* b, std::size_t m, B* to_b) {
    const std::size_t bytes = n * sizeof(A) + m * sizeof(B);
    if (bytes > pinned_bytes_) {
      cudaFreeHost(pinned_);
      pinned_ = nullptr;
      GRAUPEL_CUDA_CHECK(cudaMallocHost(&pinned_, bytes));
      pinned_bytes_ = bytes;
    }
    auto* const second = static_cast<char*>(pinned_) + n * sizeof(A);
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(pinned_, a, n * sizeof(A), cudaMemcpyDeviceToHost, stream_));
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(second, b, m * sizeof(B), cudaMemcpyDeviceToHost, stream_));
    wait();
    std::memcpy(to_a, pinned_, n * sizeof(A));
    std::memcpy(to_b, second, m * sizeof(B));
  }

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

  /// Blocks of run_segment() that fit on the GPU at once; 0: none.
  int resident_blocks() const { return resident_blocks_; }

  /// Runs what `record` launches, as a graph; recorded once for each `kind`, until forget().
  template <typename Record>
  void segment(int kind, const Record& record) {
    cudaGraphExec_t& graph = graphs_[kind];
    if (graph == nullptr) {
      cudaGraph_t captured;
      GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
      record();
      GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream_, &captured));
      GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph, captured, 0));
      GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
    }
    GRAUPEL_CUDA_CHECK(cudaGraphLaunch(graph, stream_));
  }
  /// Storage has moved: segments are recorded anew.
  void forget() {
    for (const auto& [kind, graph] : graphs_)
      if (graph != nullptr) cudaGraphExecDestroy(graph);
    graphs_.clear();
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
    kernels::particle_to_grid<<<static_cast<unsigned>(view.owner_capacity), batch::block_threads, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void update_grid(const BatchView& view) {
    const int64_t nodes = int64_t(view.node_capacity) * nodes_per_block<3>;
    kernels::update_grid<<<static_cast<unsigned>((nodes + 255) / 256), 256, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void grid_to_particle(const BatchView& view) {
    kernels::grid_to_particle<<<static_cast<unsigned>(view.owner_capacity), batch::block_threads, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void list_owners(const BatchView& view) {
    kernels::list_owners<<<1, batch::list_threads, 0, stream_>>>(view);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  /// Blocks of run_frame() that fit on the GPU at once, and the warps of each.
  int small_blocks() const { return 2 * processors_; }
  static int small_warps() { return small::warps; }
  /// `view`: SmallBatchView or ChangingBatchView.
  template <typename View>
  void run_frame(const View& view, int blocks) {
    launch_cooperative(blocks <= processors_ ? kernels::run_frame<1, View> : kernels::run_frame<2, View>, blocks,
                       small::threads, 0, view);
  }
  void run_segment(const BatchView& view) {
    launch_cooperative(kernels::run_segment, resident_blocks_, batch::resident_threads, sizeof(batch::ResidentShared),
                       view);
  }

 private:
  /// All blocks are on the GPU at once, or the launch fails.
  template <typename View>
  void launch_cooperative(void (*kernel)(View), int blocks, int threads, std::size_t shared_bytes, const View& view) {
    cudaLaunchAttribute cooperative{};
    cooperative.id = cudaLaunchAttributeCooperative;
    cooperative.val.cooperative = 1;
    cudaLaunchConfig_t config{};
    config.gridDim = static_cast<unsigned>(blocks);
    config.blockDim = static_cast<unsigned>(threads);
    config.dynamicSmemBytes = shared_bytes;
    config.stream = stream_;
    config.attrs = &cooperative;
    config.numAttrs = 1;
    GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&config, kernel, view));
  }

  cudaStream_t stream_ = nullptr;
  std::map<int, cudaGraphExec_t> graphs_;
  int processors_ = 0, resident_blocks_ = 0;
  void* pinned_ = nullptr;
  std::size_t pinned_bytes_ = 0;
  Buffer<uint8_t> scratch_;
};

}  // namespace graupel::mpm
