// Owning array on a device; copies between host and device are explicit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/parallel/device.h"

namespace graupel {

void* device_allocate(Device device, std::size_t bytes);
void device_free(Device device, void* pointer) noexcept;
/// Copies bytes between any two devices; blocks until done.
void device_copy(Device to, void* target, Device from, const void* source, std::size_t bytes);
void device_fill_zero(Device device, void* pointer, std::size_t bytes);

/// Uninitialised storage for `size()` trivially copyable elements, 64-byte aligned.
template <typename T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(Device device, std::size_t n) : device_(device) { resize_discard(n); }
  ~Buffer() { device_free(device_, data_); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  Buffer(Buffer&& o) noexcept { *this = std::move(o); }
  Buffer& operator=(Buffer&& o) noexcept {
    std::swap(device_, o.device_);
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    std::swap(capacity_, o.capacity_);
    return *this;
  }

  Device device() const { return device_; }
  std::size_t size() const { return size_; }
  T* data() { return data_; }
  const T* data() const { return data_; }
  T* begin() { return data_; }  ///< host buffers only
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  T& operator[](std::size_t i) { return data_[i]; }  ///< host buffers only
  const T& operator[](std::size_t i) const { return data_[i]; }

  /// Changes the size; the contents are lost when the buffer must grow. One that grows again takes a quarter more, of
  /// at most 32 MiB, so that a size that creeps up seldom allocates.
  void resize_discard(std::size_t n) {
    if (n > capacity_) {
      constexpr std::size_t most_spare = (std::size_t{32} << 20) / sizeof(T);
      const std::size_t capacity = std::max(n, capacity_ + std::min(capacity_ / 4, most_spare));
      device_free(device_, data_);
      data_ = nullptr;
      capacity_ = 0;
      data_ = static_cast<T*>(device_allocate(device_, capacity * sizeof(T)));
      capacity_ = capacity;
    }
    size_ = n;
  }
  void fill_zero() { device_fill_zero(device_, data_, size_ * sizeof(T)); }

  void upload(const std::vector<T>& host) {
    resize_discard(host.size());
    device_copy(device_, data_, Device::cpu, host.data(), host.size() * sizeof(T));
  }
  std::vector<T> download() const {
    std::vector<T> host(size_);
    device_copy(Device::cpu, host.data(), device_, data_, size_ * sizeof(T));
    return host;
  }

 private:
  Device device_ = Device::cpu;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace graupel
