#include "core/parallel/cuda_runtime.h"

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"

namespace graupel::cuda {

bool is_built_in() { return true; }

int device_count() {
  int count = 0;
  if (cudaGetDeviceCount(&count) == cudaSuccess) return count;
  cudaGetLastError();  // a machine without a driver is not an error here
  return 0;
}

std::string device_name() {
  cudaDeviceProp properties{};
  GRAUPEL_CUDA_CHECK(cudaGetDeviceProperties(&properties, 0));
  return properties.name;
}

int device_of(const void* pointer) {
  cudaPointerAttributes attributes{};
  if (cudaPointerGetAttributes(&attributes, pointer) != cudaSuccess) {
    cudaGetLastError();  // without a driver there is the host alone
    return -1;
  }
  return attributes.type == cudaMemoryTypeDevice ? attributes.device : -1;
}

void* allocate(std::size_t bytes) {
  void* pointer = nullptr;
  const cudaError_t status = cudaMalloc(&pointer, bytes);
  if (status == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    throw ConfigError("the GPU's memory is full (" + std::to_string(bytes) + " bytes more needed, " +
                      std::to_string(free_bytes()) +
                      " available). Use fewer particles, a larger dx, a smaller --batch or --device cpu");
  }
  GRAUPEL_CUDA_CHECK(status);
  return pointer;
}

void free(void* pointer) noexcept { cudaFree(pointer); }

void copy(void* target, const void* source, std::size_t bytes) {
  GRAUPEL_CUDA_CHECK(cudaMemcpy(target, source, bytes, cudaMemcpyDefault));
}

void fill_zero(void* pointer, std::size_t bytes) { GRAUPEL_CUDA_CHECK(cudaMemset(pointer, 0, bytes)); }

void synchronize() { GRAUPEL_CUDA_CHECK(cudaDeviceSynchronize()); }

uint64_t free_bytes() {
  std::size_t left = 0, all = 0;
  GRAUPEL_CUDA_CHECK(cudaMemGetInfo(&left, &all));
  return left;
}

double memory_bandwidth() {
  int kilohertz = 0, bits = 0;
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&kilohertz, cudaDevAttrMemoryClockRate, 0));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&bits, cudaDevAttrGlobalMemoryBusWidth, 0));
  return 2e3 * kilohertz * bits / 8;  // two transfers a clock
}

double product_peak() {
  int kilohertz = 0, processors = 0, major = 0, minor = 0;
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&kilohertz, cudaDevAttrClockRate, 0));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, 0));
  // Of a multiprocessor in a clock: A100 2,048, each generation of data centres' GPUs since twice that.
  const double a_clock = minor != 0 ? 0 : major == 8 ? 2048 : major == 9 ? 4096 : major == 10 ? 8192 : 0;
  return 1e3 * kilohertz * processors * a_clock;
}

}  // namespace graupel::cuda
