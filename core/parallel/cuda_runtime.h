// What Graupel asks of the CUDA runtime, for code that does not know whether it was built with CUDA
// (cuda_runtime.cpp, without_cuda.cpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace graupel::cuda {

bool is_built_in();
/// GPUs that can be used; 0 without a driver.
int device_count();
std::string device_name();
/// Number of the GPU in whose memory a pointer lies; -1 on the host.
int device_of(const void* pointer);

/// All throw std::runtime_error with CUDA's text; in a build without CUDA std::logic_error.
void* allocate(std::size_t bytes);  ///< throws ConfigError where the GPU's memory is full
void free(void* pointer) noexcept;
void copy(void* target, const void* source, std::size_t bytes);  ///< between host and device or on one of them
void fill_zero(void* pointer, std::size_t bytes);
void synchronize();

uint64_t free_bytes();
double memory_bandwidth();  ///< as cuda_memory_bandwidth() (core/parallel/memory.h)
double product_peak();      ///< as cuda_product_peak()

}  // namespace graupel::cuda
