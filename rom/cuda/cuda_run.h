// Runs of a reduced-order model on a GPU, where the program was built with CUDA.
#pragma once

#include <memory>
#include <vector>

#include "rom/cuda/device_tables.h"

namespace graupel::rom::device {

class DeviceRun;
struct RunSettings;

/// Throws ConfigError where the GPU lacks the shared memory that so many samples need.
std::unique_ptr<DeviceRun> make_cuda_run(const ModelTable& model, std::vector<InstanceTable> tables,
                                         const RunSettings& settings);

}  // namespace graupel::rom::device
