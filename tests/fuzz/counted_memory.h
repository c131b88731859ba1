// The largest piece of memory that operator new was asked for, in the test program that links counted_memory.cpp.
#pragma once

#include <atomic>
#include <cstddef>

namespace graupel::fuzz {

extern std::atomic<std::size_t> largest_request;  ///< [bytes]

}  // namespace graupel::fuzz
