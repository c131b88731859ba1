// Names of what runs are timed on.
#pragma once

#include <string>

#include "core/parallel/device.h"

namespace graupel {

/// Name of the processor; "unknown processor" where the system does not tell.
std::string processor_name();
/// What a run of so many threads is timed on: "NVIDIA H200", "2 threads of AMD EPYC".
std::string hardware_name(Device device, int threads);

}  // namespace graupel
