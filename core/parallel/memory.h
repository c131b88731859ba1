// How much memory a device still has for this process.
#pragma once

#include <cstdint>
#include <string>

#include "core/parallel/device.h"

namespace graupel {

/// Bytes that can still be taken. On the CPU what the system calls available, or what the control groups of this
/// process leave where that is less (caches of files count as free); on a GPU its free memory. The largest number when
/// unknown.
uint64_t available_bytes(Device device);

/// The same on the CPU with the files of the kernel below `root` ("/" for the real ones).
uint64_t available_host_bytes(const std::string& root);

/// Peak of a GPU's memory from its clock and width [bytes/s]; 0 without a GPU.
double cuda_memory_bandwidth();

/// Peak of a GPU's matrix products, bf16 operands and f32 sums without sparsity, from its clock and multiprocessors
/// [FLOP/s]; 0 without a GPU and for architectures that are not known (8.0, 9.0 and 10.0 are).
double cuda_product_peak();

}  // namespace graupel
