#include "core/parallel/instruction_set.h"

#include <cstdlib>

#include "core/system/error.h"

namespace graupel {

namespace {

/// Clang before 17, which checks this file, does not know the levels by name.
bool runs_here(InstructionSet set) {
#if defined(GRAUPEL_X86_KERNELS) && !defined(__clang__)
  __builtin_cpu_init();
  if (set == InstructionSet::avx512) return __builtin_cpu_supports("x86-64-v4");
  if (set == InstructionSet::avx2) return __builtin_cpu_supports("x86-64-v3");
#endif
  return set == InstructionSet::baseline;
}

}  // namespace

const char* name_of(InstructionSet set) {
  switch (set) {
    case InstructionSet::avx512:
      return "avx512";
    case InstructionSet::avx2:
      return "avx2";
    case InstructionSet::baseline:
      break;
  }
  return "baseline";
}

std::vector<InstructionSet> available_instruction_sets() {
  std::vector<InstructionSet> available;
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512})
    if (runs_here(set)) available.push_back(set);
  return available;
}

InstructionSet choose_instruction_set(const std::string& wanted) {
  const std::vector<InstructionSet> available = available_instruction_sets();
  if (wanted.empty()) return available.back();
  std::string names;
  for (const InstructionSet set : available) {
    if (wanted == name_of(set)) return set;
    names += (names.empty() ? "" : ", ") + std::string(name_of(set));
  }
  const bool known = wanted == "avx2" || wanted == "avx512";
  throw ConfigError("GRAUPEL_SIMD names an instruction set that " +
                    std::string(known ? "this processor does not run" : "is not known") + " (" + wanted +
                    ", allowed here: " + names + "). Choose one of these, or unset GRAUPEL_SIMD for the best");
}

InstructionSet instruction_set() {
  static const InstructionSet chosen = [] {
    const char* wanted = std::getenv("GRAUPEL_SIMD");
    return choose_instruction_set(wanted == nullptr ? "" : wanted);
  }();
  return chosen;
}

}  // namespace graupel
