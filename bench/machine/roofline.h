// What bounds a substep of MPM, the bytes it must move and the instructions it takes, and what bounds a network, its
// products, beside what the machine can do.
#pragma once

#include <cstdint>
#include <optional>

#include "core/parallel/device.h"
#include "core/scene/material_config.h"

namespace graupel::bench {

/// Bytes of particle state that a substep reads and writes at least, whatever the order of its phases: the state before
/// P2G, the state before and after G2P. Grid nodes come on top. `real` is the size of a number [bytes].
int64_t least_bytes_per_update(MaterialModel model, int64_t real);

/// Of a GPU from its memory's clock and width; of the CPU as measured by a = b + s c on all threads [bytes/s].
double memory_bandwidth(Device device);

/// Matrix products of networks [FLOP/s]: of a GPU in bf16 from its clock (0: unknown); of the CPU as measured of the
/// engine's own layers, rows in the cache, on all threads, in the numbers that they are in use with.
double product_rate(Device device);

/// Instructions and cycles of this process in user mode between start() and stop(); nothing where the system does not
/// let a program count them.
class InstructionCounter {
 public:
  InstructionCounter();
  ~InstructionCounter();
  InstructionCounter(const InstructionCounter&) = delete;
  InstructionCounter& operator=(const InstructionCounter&) = delete;

  struct Count {
    double instructions = 0, cycles = 0;
  };
  void start();
  std::optional<Count> stop();

 private:
  int instructions_ = -1, cycles_ = -1;  ///< file descriptors
};

}  // namespace graupel::bench
