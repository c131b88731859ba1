// Changes a safetensors file and keeps its ranges right: what tries the checks behind the format's.
#pragma once

#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace graupel::fuzz {

/// One tensor, name, shape or entry of the metadata; mutate_bytes() in one of eight cases and where the file is
/// damaged.
std::string mutate_weights(const std::string& bytes, std::size_t most, Random& random);

}  // namespace graupel::fuzz
