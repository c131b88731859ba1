// Which instruction set the CPU's hot loops run with, those of the solver and of the networks: chosen once, when a
// program starts.
#pragma once

#include <string>
#include <vector>

namespace graupel {

/// In ascending order; each contains the ones before. On processors other than x86-64 only the baseline is compiled.
enum class InstructionSet {
  baseline,  ///< what the compiler's target has: SSE2 on x86-64
  avx2,      ///< x86-64-v3: AVX2 and FMA
  avx512     ///< x86-64-v4
};

/// "baseline", "avx2" or "avx512".
const char* name_of(InstructionSet set);
/// Those that this program has code for and this processor runs.
std::vector<InstructionSet> available_instruction_sets();
/// The best of them, or what `wanted` names if it is not empty; throws ConfigError for an unknown word, or a set that
/// is not available.
InstructionSet choose_instruction_set(const std::string& wanted);
/// choose_instruction_set() of the environment variable GRAUPEL_SIMD, once.
InstructionSet instruction_set();

}  // namespace graupel
