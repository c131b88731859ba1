#include "graph/device_lists.h"

#ifdef __CUDACC__
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cuda/std/functional>
#endif

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "core/cuda_check.h"

namespace graupel::graph {

namespace {

#ifdef __CUDACC__
/// Calls one of CUB's operations twice: for the memory that it needs, and to work.
template <typename Operation>
void with_scratch(ListScratch& scratch, const Operation& operation) {
  std::size_t bytes = 0;
  GRAUPEL_CUDA_CHECK(operation(nullptr, bytes));
  if (bytes > scratch.bytes.size()) scratch.bytes.resize_discard(bytes);
  bytes = scratch.bytes.size();
  GRAUPEL_CUDA_CHECK(operation(scratch.bytes.data(), bytes));
}
#else
[[noreturn]] void no_cuda() { throw std::logic_error("device_lists: this file was not compiled for CUDA"); }
#endif

template <typename T>
void sum_up(Device device, int64_t n, const T* value, T* sums, ListScratch& scratch, void* stream) {
  if (device == Device::cpu) {
    T sum{};
    for (int64_t i = 0; i < n; ++i) {
      sums[i] = sum;
      sum = sum + value[i];
    }
    sums[n] = sum;
    return;
  }
#ifdef __CUDACC__
  with_scratch(scratch, [&](void* memory, std::size_t& bytes) {
    return cub::DeviceScan::ExclusiveScan(memory, bytes, value, sums, cuda::std::plus<>{}, T{}, static_cast<int>(n + 1),
                                          static_cast<cudaStream_t>(stream));
  });
#else
  static_cast<void>(scratch), static_cast<void>(stream);
  no_cuda();
#endif
}

}  // namespace

void running_sums(Device device, int64_t n, const int32_t* value, int32_t* sums, ListScratch& scratch, void* stream) {
  sum_up(device, n, value, sums, scratch, stream);
}

void running_sums(Device device, int64_t n, const LinkCount* value, LinkCount* sums, ListScratch& scratch,
                  void* stream) {
  sum_up(device, n, value, sums, scratch, stream);
}

void sort_by_key(Device device, int64_t n, int bits, const int32_t* key, const int32_t* value, int32_t* sorted_key,
                 int32_t* sorted_value, ListScratch& scratch, void* stream) {
  if (n == 0) return;
  if (device == Device::cpu) {
    std::vector<int32_t> place(static_cast<std::size_t>(n));
    std::iota(place.begin(), place.end(), 0);
    std::stable_sort(place.begin(), place.end(), [&](int32_t a, int32_t b) { return key[a] < key[b]; });
    for (int64_t i = 0; i < n; ++i) {
      const int32_t from = place[static_cast<std::size_t>(i)];
      sorted_key[i] = key[from];
      sorted_value[i] = value[from];
    }
    return;
  }
#ifdef __CUDACC__
  with_scratch(scratch, [&](void* memory, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(memory, bytes, key, sorted_key, value, sorted_value, static_cast<int>(n), 0,
                                           bits, static_cast<cudaStream_t>(stream));
  });
#else
  static_cast<void>(bits), static_cast<void>(scratch), static_cast<void>(stream);
  no_cuda();
#endif
}

}  // namespace graupel::graph
