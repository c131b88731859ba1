#include "core/parallel/device.h"

#include <omp.h>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"

namespace graupel {

bool cuda_available() {
#ifdef GRAUPEL_HAVE_CUDA
  int count = 0;
  if (cudaGetDeviceCount(&count) != cudaSuccess) {
    cudaGetLastError();  // a machine without a driver is not an error here
    return false;
  }
  return count > 0;
#else
  return false;
#endif
}

Device parse_device(const std::string& word) {
  if (word == "cpu") return Device::cpu;
  if (word == "auto") return cuda_available() ? Device::cuda : Device::cpu;
  if (word == "cuda") {
    if (cuda_available()) return Device::cuda;
#ifdef GRAUPEL_HAVE_CUDA
    throw ConfigError("device 'cuda' is not usable (no NVIDIA GPU or driver was found). Use --device cpu");
#else
    throw ConfigError(
        "device 'cuda' is not usable (this build has no CUDA). Rebuild where nvcc is, or use --device cpu");
#endif
  }
  throw ConfigError("unknown device '" + word + "' (allowed: auto, cpu, cuda)");
}

std::string cuda_device_name() {
#ifdef GRAUPEL_HAVE_CUDA
  if (!cuda_available()) return "";
  cudaDeviceProp properties{};
  GRAUPEL_CUDA_CHECK(cudaGetDeviceProperties(&properties, 0));
  return properties.name;
#else
  return "";
#endif
}

void synchronize([[maybe_unused]] Device device) {
#ifdef GRAUPEL_HAVE_CUDA
  if (device == Device::cuda) GRAUPEL_CUDA_CHECK(cudaDeviceSynchronize());
#endif
}

void set_num_threads(int threads) { omp_set_num_threads(threads > 0 ? threads : omp_get_num_procs()); }
int num_threads() { return omp_get_max_threads(); }

}  // namespace graupel
