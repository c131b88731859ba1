// Mutations of bytes for programs without libFuzzer: mutate_bytes() of fuzz_target.h.
#pragma once

#include <cstdint>

namespace graupel::fuzz {

/// What mutate_bytes() draws from here on.
void seed_byte_mutations(uint32_t seed);

}  // namespace graupel::fuzz
