#include "nn/row_kernels.h"

namespace graupel::nn {

// The tables that simd/kernels.cpp defines, once for each instruction set.
namespace baseline {
extern const RowKernels kernels;
}
#ifdef GRAUPEL_X86_KERNELS
namespace avx2 {
extern const RowKernels kernels;
}
namespace avx512 {
extern const RowKernels kernels;
}
#endif

const RowKernels& row_kernels(InstructionSet set) {
#ifdef GRAUPEL_X86_KERNELS
  if (set == InstructionSet::avx512) return avx512::kernels;
  if (set == InstructionSet::avx2) return avx2::kernels;
#endif
  static_cast<void>(set);
  return baseline::kernels;
}

}  // namespace graupel::nn
