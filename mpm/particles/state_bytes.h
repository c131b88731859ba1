// A saved state as bytes: whose it is, the parts that a solver adds, a checksum.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "core/parallel/buffer.h"
#include "core/scene/scene.h"

namespace graupel::mpm {

/// Solvers sum in different orders, and instruction sets round differently, so each continues its own states only.
enum class SolverKind : uint32_t { cpu_portable, gpu_portable, gpu_tuned, cpu_baseline, cpu_avx2, cpu_avx512 };

/// What a state belongs to.
struct StateOwner {
  uint64_t scene = 0;  ///< scene_hash()
  SolverKind solver = SolverKind::cpu_portable;
  uint32_t scalar_bytes = 4;
  int64_t particles = 0;
};

class StateWriter {
 public:
  /// `content_bytes`: of all parts that will be added.
  StateWriter(const StateOwner& owner, std::size_t content_bytes);

  template <typename T>
  void add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    add_bytes(&value, sizeof(value));
  }
  template <typename T>
  void add(const Buffer<T>& buffer) {
    const std::vector<T> host = buffer.download();
    add_bytes(host.data(), host.size() * sizeof(T));
  }
  template <typename T>
  void add(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    add_bytes(values.data(), values.size() * sizeof(T));
  }
  std::vector<std::byte> finish();

 private:
  void add_bytes(const void* from, std::size_t n);
  std::vector<std::byte> bytes_;
};

class StateReader {
 public:
  /// Throws InputError when the bytes are no state, belong to something else, are damaged, or do not hold
  /// `content_bytes` of parts.
  StateReader(const std::vector<std::byte>& bytes, const StateOwner& owner, std::size_t content_bytes);

  template <typename T>
  void get(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    std::memcpy(static_cast<void*>(&value), take(sizeof(value)), sizeof(value));
  }
  template <typename T>
  void get(Buffer<T>& buffer) {
    device_copy(buffer.device(), buffer.data(), Device::cpu, take(buffer.size() * sizeof(T)),
                buffer.size() * sizeof(T));
  }
  template <typename T>
  void get(std::vector<T>& values) {
    const std::byte* from = take(values.size() * sizeof(T));
    if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), from, values.size() * sizeof(T));
  }

 private:
  const std::byte* take(std::size_t n);
  const std::byte *next_, *end_;
};

}  // namespace graupel::mpm
