// The fuzzer: one program for all targets, GRAUPEL_FUZZ_TARGET in the environment names one.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "core/system/error.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" std::size_t LLVMFuzzerMutate(uint8_t* data, std::size_t size, std::size_t most);

namespace graupel::fuzz {

std::string mutate_bytes(std::string bytes, std::size_t most) {
  const std::size_t size = std::min(bytes.size(), most);
  bytes.resize(most);
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<uint8_t*>(bytes.data()), size, most));
  return bytes;
}

namespace {

const Target& chosen() {
  static const Target* target = [] {
    const char* name = std::getenv("GRAUPEL_FUZZ_TARGET");
    for (const Target* each : all_targets)
      if (name != nullptr && std::strcmp(each->name, name) == 0) return each;
    std::fprintf(stderr, "GRAUPEL_FUZZ_TARGET must name a target:");
    for (const Target* each : all_targets) std::fprintf(stderr, " %s", each->name);
    std::fprintf(stderr, "\n");
    std::exit(2);
  }();
  return *target;
}

}  // namespace

}  // namespace graupel::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  try {
    graupel::fuzz::chosen().run({reinterpret_cast<const char*>(data), size});
  } catch (const graupel::Error&) {
    return 0;
  }
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(uint8_t* data, std::size_t size, std::size_t most, unsigned int seed) {
  const graupel::fuzz::Target& target = graupel::fuzz::chosen();
  if (target.mutate == nullptr) return LLVMFuzzerMutate(data, size, most);
  graupel::fuzz::Random random(seed);
  const std::string changed = target.mutate({reinterpret_cast<const char*>(data), size}, most, random);
  if (changed.size() > most) return LLVMFuzzerMutate(data, size, most);
  std::memcpy(data, changed.data(), changed.size());
  return changed.size();
}
