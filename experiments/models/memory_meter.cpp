#include "experiments/models/memory_meter.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "core/parallel/memory.h"

namespace graupel::experiments {

namespace {

/// A line of /proc/self/status in bytes; 0 where there is none.
double status_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key + ":")) return 1024 * std::stod(line.substr(key.size() + 1));
  return 0;
}

}  // namespace

MemoryMeter::MemoryMeter() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // sets VmHWM back to the present size
  before_ = status_bytes("VmRSS");
}

double MemoryMeter::peak() const {
  const double high = status_bytes("VmHWM");
  if (high > 0) return high;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

double MemoryMeter::added() const { return std::max(0.0, peak() - before_); }

DeviceMemoryMeter::DeviceMemoryMeter(Device device) : device_(device) {
  if (device == Device::cuda) free_before_ = static_cast<double>(available_bytes(device));
}

void DeviceMemoryMeter::look() {
  if (device_ == Device::cuda) taken_ = std::max(taken_, free_before_ - static_cast<double>(available_bytes(device_)));
}

}  // namespace graupel::experiments
