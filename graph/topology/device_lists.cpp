#include "graph/topology/device_lists.h"

#ifdef __CUDACC__
#include <thrust/iterator/transform_iterator.h>

#include <cub/device/device_scan.cuh>
#include <cuda/std/functional>

#include "graph/topology/prefix_sums.cuh"
#endif

#include <bit>
#include <stdexcept>

#include "core/parallel/cuda_check.h"

namespace graupel::graph {

namespace {

struct BitsOf {
  GRAUPEL_HD int32_t operator()(uint32_t word) const {
#ifdef __CUDA_ARCH__
    return __popc(word);
#else
    return std::popcount(word);
#endif
  }
};
struct Same {
  template <typename T>
  GRAUPEL_HD T operator()(const T& value) const {
    return value;
  }
};

#ifdef __CUDACC__
template <typename T, typename From, typename Value>
void sum_up_on_gpu(int64_t n, const int32_t* present, const From* from, Value value, T* sums, ListScratch& scratch,
                   cudaStream_t stream) {
  if (n <= most_in_one_launch) return launch_prefix_sums(n, present, from, value, sums, stream);
  const auto scan = [&](void* memory, std::size_t& bytes) {
    return cub::DeviceScan::ExclusiveScan(memory, bytes, thrust::make_transform_iterator(from, value), sums,
                                          cuda::std::plus<>{}, T{}, static_cast<int>(n + 1), stream);
  };
  std::size_t bytes = 0;
  GRAUPEL_CUDA_CHECK(scan(nullptr, bytes));
  if (bytes > scratch.bytes.size()) scratch.bytes.resize_discard(bytes);
  bytes = scratch.bytes.size();
  GRAUPEL_CUDA_CHECK(scan(scratch.bytes.data(), bytes));
}
#else
[[noreturn]] void no_cuda() { throw std::logic_error("device_lists: this file was not compiled for CUDA"); }
#endif

template <typename T, typename From, typename Value>
void sum_up(Device device, int64_t n, const int32_t* present, const From* from, Value value, T* sums,
            ListScratch& scratch, void* stream) {
  if (device == Device::cpu) {
    if (present) n = *present;
    T sum{};
    for (int64_t i = 0; i < n; ++i) {
      sums[i] = sum;
      sum = sum + value(from[i]);
    }
    sums[n] = sum;
    return;
  }
#ifdef __CUDACC__
  sum_up_on_gpu(n, present, from, value, sums, scratch, static_cast<cudaStream_t>(stream));
#else
  static_cast<void>(scratch), static_cast<void>(stream);
  no_cuda();
#endif
}

}  // namespace

void prefix_sums(Device device, int64_t n, const int32_t* value, int32_t* sums, ListScratch& scratch, void* stream,
                 const int32_t* present) {
  sum_up(device, n, present, value, Same{}, sums, scratch, stream);
}

void prefix_sums(Device device, int64_t n, const LinkCount* value, LinkCount* sums, ListScratch& scratch, void* stream,
                 const int32_t* present) {
  sum_up(device, n, present, value, Same{}, sums, scratch, stream);
}

void count_bits(Device device, int64_t n, const uint32_t* words, int32_t* sums, ListScratch& scratch, void* stream) {
  sum_up(device, n, nullptr, words, BitsOf{}, sums, scratch, stream);
}

}  // namespace graupel::graph
