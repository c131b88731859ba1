// A step that a GPU's memory is too small for says what to do.
#include "train/networks/gpu_memory_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace graupel::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(GpuMemory, AStepWithoutMemorySaysWhatToDo) {
  const auto step = []() -> int { C10_THROW_ERROR(OutOfMemoryError, "Tried to allocate 2.40 GiB"); };
  EXPECT_THAT([&] { within_gpu_memory(31415, step); },
              testing::ThrowsMessage<GpuMemoryError>(
                  AllOf(HasSubstr("31415 particles (Tried to allocate 2.40 GiB)"), HasSubstr("Lower batch_scenes"))));
}

TEST(GpuMemory, OtherResultsAndErrorsPass) {
  EXPECT_EQ(within_gpu_memory(1, [] { return 7; }), 7);
  EXPECT_THROW(within_gpu_memory(1, []() -> int { throw CommError("gone"); }), CommError);
}

}  // namespace
}  // namespace graupel::train
