#include "core/parallel/hardware.h"

#include <fstream>

namespace graupel {

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

std::string hardware_name(Device device, int threads) {
  if (device == Device::cuda) return cuda_device_name();
  return std::to_string(threads) + (threads == 1 ? " thread of " : " threads of ") + processor_name();
}

}  // namespace graupel
