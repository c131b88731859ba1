// Kernels over several items: block row y of a launch works on item y. Items are arguments of the kernel, so that a
// recorded launch owns them. With one item it is an ordinary launch.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "core/parallel/cuda_check.h"

namespace graupel {

/// Bytes of a kernel's arguments.
#if CUDART_VERSION >= 12010
inline constexpr std::size_t most_argument_bytes = 32000;
#else
inline constexpr std::size_t most_argument_bytes = 4000;
#endif

/// The only argument of a kernel of launch_items(), as `const __grid_constant__`.
template <typename T, int most>
struct LaunchItems {
  static_assert(std::is_trivially_copyable_v<T>);
  alignas(T) unsigned char bytes[most * sizeof(T)];
  /// The item of the calling block.
  __device__ const T& own() const { return reinterpret_cast<const T*>(bytes)[most == 1 ? 0 : blockIdx.y]; }
};

template <typename T>
inline constexpr int most_launch_items = static_cast<int>(std::clamp<std::size_t>(most_argument_bytes / sizeof(T), 1,
                                                                                  64));

/// launch(items, count) for all of `all`, count at a time: launches a kernel of (.., count) blocks.
template <typename T, typename Launch>
void launch_items(const std::vector<T>& all, const Launch& launch) {
  const auto fill = [&](auto& items, std::size_t first, std::size_t count) {
    std::memcpy(items.bytes, all.data() + first, count * sizeof(T));
    launch(items, static_cast<unsigned>(count));
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  };
  constexpr int most = most_launch_items<T>;
  for (std::size_t first = 0; first < all.size(); first += most) {
    const std::size_t count = std::min<std::size_t>(most, all.size() - first);
    if (count == 1) {
      LaunchItems<T, 1> items;
      fill(items, first, 1);
    } else {
      LaunchItems<T, most> items;
      fill(items, first, count);
    }
  }
}

/// Each item has a body and its n.
template <typename Items>
__global__ void loops_kernel(const __grid_constant__ Items items) {
  const int64_t i = static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  const auto& loop = items.own();
  if (i < loop.n) loop.body(i);
}

}  // namespace graupel
