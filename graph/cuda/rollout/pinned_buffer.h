// Host memory that a GPU copies from and to in a stream's order.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "core/parallel/cuda_check.h"

namespace graupel::graph {

template <typename T>
class PinnedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  PinnedBuffer() = default;
  ~PinnedBuffer() { cudaFreeHost(data_); }
  PinnedBuffer(const PinnedBuffer&) = delete;
  PinnedBuffer& operator=(const PinnedBuffer&) = delete;

  /// What it holds is lost where it grows, the second time by a quarter at least; no copy may be under way.
  void reserve_discard(std::size_t n) {
    if (n <= capacity_) return;
    n = std::max(n, capacity_ + capacity_ / 4);
    cudaFreeHost(data_);
    data_ = nullptr;
    capacity_ = 0;
    GRAUPEL_CUDA_CHECK(cudaMallocHost(&data_, n * sizeof(T)));
    capacity_ = n;
  }
  T* data() { return data_; }
  const T* data() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

}  // namespace graupel::graph
