#include "core/parallel/buffer.h"

#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>

#include "core/parallel/cuda_check.h"
#include "core/parallel/memory.h"
#include "core/system/error.h"

namespace graupel {

namespace {
[[noreturn]] [[maybe_unused]] void no_cuda() { throw std::logic_error("this build has no CUDA"); }
}  // namespace

void* device_allocate(Device device, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  if (device == Device::cpu) {
    void* pointer = std::aligned_alloc(64, (bytes + 63) / 64 * 64);
    if (pointer == nullptr) throw std::bad_alloc();
    return pointer;
  }
#ifdef GRAUPEL_HAVE_CUDA
  void* pointer = nullptr;
  const cudaError_t status = cudaMalloc(&pointer, bytes);
  if (status == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    throw ConfigError("the GPU's memory is full (" + std::to_string(bytes) + " bytes more needed, " +
                      std::to_string(available_bytes(Device::cuda)) +
                      " available). Use fewer particles, a larger dx, a smaller --batch or --device cpu");
  }
  GRAUPEL_CUDA_CHECK(status);
  return pointer;
#else
  no_cuda();
#endif
}

void device_free(Device device, void* pointer) noexcept {
  if (pointer == nullptr) return;
  if (device == Device::cpu) std::free(pointer);
#ifdef GRAUPEL_HAVE_CUDA
  if (device == Device::cuda) cudaFree(pointer);
#endif
}

void device_copy(Device to, void* target, Device from, const void* source, std::size_t bytes) {
  if (bytes == 0) return;
  if (to == Device::cpu && from == Device::cpu) {
    std::memcpy(target, source, bytes);
    return;
  }
#ifdef GRAUPEL_HAVE_CUDA
  GRAUPEL_CUDA_CHECK(cudaMemcpy(target, source, bytes, cudaMemcpyDefault));
#else
  no_cuda();
#endif
}

void device_fill_zero(Device device, void* pointer, std::size_t bytes) {
  if (bytes == 0) return;
  if (device == Device::cpu) {
    std::memset(pointer, 0, bytes);
    return;
  }
#ifdef GRAUPEL_HAVE_CUDA
  GRAUPEL_CUDA_CHECK(cudaMemset(pointer, 0, bytes));
#else
  no_cuda();
#endif
}

}  // namespace graupel
