#include "core/parallel/buffer.h"

#include <cstdlib>
#include <cstring>
#include <new>

#include "core/parallel/cuda_runtime.h"

namespace graupel {

void* device_allocate(Device device, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  if (device == Device::cuda) return cuda::allocate(bytes);
  void* pointer = std::aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

void device_free(Device device, void* pointer) noexcept {
  if (pointer == nullptr) return;
  if (device == Device::cpu) std::free(pointer);
  if (device == Device::cuda) cuda::free(pointer);
}

void device_copy(Device to, void* target, Device from, const void* source, std::size_t bytes) {
  if (bytes == 0) return;
  if (to == Device::cpu && from == Device::cpu)
    std::memcpy(target, source, bytes);
  else
    cuda::copy(target, source, bytes);
}

void device_fill_zero(Device device, void* pointer, std::size_t bytes) {
  if (bytes == 0) return;
  if (device == Device::cpu)
    std::memset(pointer, 0, bytes);
  else
    cuda::fill_zero(pointer, bytes);
}

}  // namespace graupel
