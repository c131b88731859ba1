#include "tests/fuzz/harmless.h"

#include <gtest/gtest.h>

#include <ctime>

#include "core/system/error.h"
#include "tests/fuzz/counted_memory.h"

namespace graupel::fuzz {

namespace {

constexpr std::size_t most_at_once = std::size_t(64) << 20;  ///< [bytes]; inputs are below 100 kB
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr double most_seconds = 200;
#else
constexpr double most_seconds = 10;  ///< of processor time; usual are milliseconds
#endif

}  // namespace

bool expect_harmless(const Target& target, const std::string& bytes, const std::string& name) {
  largest_request = 0;
  const std::clock_t start = std::clock();
  bool taken = false;
  try {
    target.run(bytes);
    taken = true;
  } catch (const Error& error) {
    EXPECT_STRNE(error.what(), "") << name;
  } catch (const std::exception& error) {
    ADD_FAILURE() << name << ": " << error.what();
  }
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, most_seconds) << name;
  EXPECT_LT(largest_request.load(), most_at_once) << name;
  return taken;
}

}  // namespace graupel::fuzz
