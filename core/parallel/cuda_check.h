// Turns a failed CUDA call into an exception with file, line and CUDA's own text.
#pragma once

#ifdef GRAUPEL_HAVE_CUDA
#include <cuda_runtime.h>

#include <stdexcept>
#include <string>

#define GRAUPEL_CUDA_CHECK(call)                                                                        \
  do {                                                                                                  \
    const cudaError_t graupel_status = (call);                                                          \
    if (graupel_status != cudaSuccess)                                                                  \
      throw std::runtime_error(std::string(__FILE__ ":") + std::to_string(__LINE__) + ": " #call ": " + \
                               cudaGetErrorString(graupel_status));                                     \
  } while (false)
#endif
