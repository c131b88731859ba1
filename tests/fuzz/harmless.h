// What an input may do at most to the program that reads it.
#pragma once

#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace graupel::fuzz {

/// Expects the target to take the input or to refuse it with a message, quickly, and with no more memory than its size
/// justifies; `name` is for messages. Whether it is taken.
bool expect_harmless(const Target& target, const std::string& bytes, const std::string& name);

}  // namespace graupel::fuzz
