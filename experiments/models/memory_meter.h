// What a run takes of the memory of the process, and of a GPU.
#pragma once

#include "core/parallel/device.h"

namespace graupel::experiments {

/// Resident memory of the process while this object lives [bytes].
class MemoryMeter {
 public:
  MemoryMeter();  ///< resets the kernel's peak
  double peak() const;
  double added() const;

 private:
  double before_;
};

/// What a run takes of a GPU's memory [bytes]; 0 on the CPU. Other processes on that GPU would be counted, too.
class DeviceMemoryMeter {
 public:
  explicit DeviceMemoryMeter(Device device);
  void look();  ///< at what the run holds now
  double taken() const { return taken_; }

 private:
  Device device_;
  double free_before_ = 0, taken_ = 0;
};

}  // namespace graupel::experiments
