// Ends a test, visibly skipped, where no GPU can run its CUDA half.
#pragma once

#include <gtest/gtest.h>

#include "core/parallel/device.h"

namespace graupel {

#ifdef GRAUPEL_HAVE_CUDA
inline constexpr const char* why_cuda_is_skipped = "no GPU here: the CUDA path was compiled but not run";
#else
inline constexpr const char* why_cuda_is_skipped = "built without CUDA: its path was neither compiled nor run";
#endif

}  // namespace graupel

#define GRAUPEL_NEEDS_GPU() \
  if (!graupel::cuda_available()) GTEST_SKIP() << graupel::why_cuda_is_skipped
