// Steps that a GPU's memory is too small for: libtorch's error in words that say what to do.
#pragma once

#include <c10/util/Exception.h>
#include <fmt/format.h>

#include <cstdint>
#include <utility>

#include "train/networks/network_module.h"

namespace graupel::train {

/// What `step` of so many particles returns. Throws GpuMemoryError where libtorch finds no memory.
template <typename Step>
decltype(auto) within_gpu_memory(int64_t particles, Step&& step) {
  try {
    return std::forward<Step>(step)();
  } catch (const c10::OutOfMemoryError& error) {
    throw GpuMemoryError(fmt::format(
        "the GPU's memory is too small for a step of {} particles ({}). Lower batch_scenes; for GNS also set "
        "checkpoint_layers=2 or more",
        particles, error.what_without_backtrace()));
  }
}

}  // namespace graupel::train
