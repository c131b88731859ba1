// Where a kernel runs and where a buffer lies.
#pragma once

#include <string>

namespace graupel {

enum class Device { cpu, cuda };

inline const char* name_of(Device device) { return device == Device::cpu ? "cpu" : "cuda"; }

/// Whether the program was built with CUDA and this machine has a usable GPU.
bool cuda_available();

/// "auto", "cpu" or "cuda" -> device; throws ConfigError for another word or for "cuda" without a GPU.
Device parse_device(const std::string& word);

/// Name of the GPU in use, empty without one.
std::string cuda_device_name();

/// Waits until the device has finished; throws std::runtime_error with the text of any pending CUDA error.
void synchronize(Device device);

/// Number of CPU threads that parallel_for uses. 0 chooses all the process may use.
void set_num_threads(int threads);
int num_threads();

}  // namespace graupel
