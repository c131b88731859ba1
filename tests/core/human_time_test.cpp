#include "core/system/human_time.h"

#include <gtest/gtest.h>

namespace graupel {
namespace {

TEST(HumanTime, TwoUnitsAtMost) {
  EXPECT_EQ(human_time(0.0042), "4.2 ms");
  EXPECT_EQ(human_time(4.2), "4.2 s");
  EXPECT_EQ(human_time(200), "3 min 20 s");
  EXPECT_EQ(human_time(3720), "1 h 02 min");
}

}  // namespace
}  // namespace graupel
