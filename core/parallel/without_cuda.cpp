// Stands in for cuda_runtime.cpp in a build without CUDA.
#include <stdexcept>

#include "core/parallel/cuda_runtime.h"

namespace graupel::cuda {

namespace {
[[noreturn]] void no_cuda() { throw std::logic_error("this build has no CUDA"); }
}  // namespace

bool is_built_in() { return false; }
int device_count() { return 0; }
std::string device_name() { no_cuda(); }
int device_of(const void*) { return -1; }
void* allocate(std::size_t) { no_cuda(); }
void free(void*) noexcept {}
void copy(void*, const void*, std::size_t) { no_cuda(); }
void fill_zero(void*, std::size_t) { no_cuda(); }
void synchronize() {}
uint64_t free_bytes() { no_cuda(); }
double memory_bandwidth() { return 0; }
double product_peak() { return 0; }

}  // namespace graupel::cuda
