#include "core/parallel/device.h"

#include <omp.h>

#include "core/parallel/cuda_runtime.h"
#include "core/system/error.h"

namespace graupel {

bool cuda_available() { return cuda::device_count() > 0; }

Device parse_device(const std::string& word) {
  if (word == "cpu") return Device::cpu;
  if (word == "auto") return cuda_available() ? Device::cuda : Device::cpu;
  if (word == "cuda") {
    if (cuda_available()) return Device::cuda;
    throw ConfigError(cuda::is_built_in()
                          ? "device 'cuda' is not usable (no NVIDIA GPU or driver was found). Use device 'cpu'"
                          : "device 'cuda' is not usable (this build has no CUDA). Rebuild where nvcc is, or use "
                            "device 'cpu'");
  }
  throw ConfigError("unknown device '" + word + "' (allowed: auto, cpu, cuda)");
}

std::string cuda_device_name() { return cuda_available() ? cuda::device_name() : ""; }

void synchronize(Device device) {
  if (device == Device::cuda) cuda::synchronize();
}

void set_num_threads(int threads) { omp_set_num_threads(threads > 0 ? threads : omp_get_num_procs()); }
int num_threads() { return omp_get_max_threads(); }

}  // namespace graupel
