// Stands in for the kernels in a build without CUDA.
#include "core/system/error.h"
#include "rom/cuda/cuda_run.h"
#include "rom/cuda/device_run.h"

namespace graupel::rom::device {

std::unique_ptr<DeviceRun> make_cuda_run(const ModelTable&, std::vector<InstanceTable>, const RunSettings&) {
  throw ConfigError(
      "reduced models cannot run on the GPU (this build has no CUDA). Rebuild where nvcc is, or use device 'cpu'");
}

}  // namespace graupel::rom::device
