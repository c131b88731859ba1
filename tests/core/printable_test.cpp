#include "core/system/printable.h"

#include <gtest/gtest.h>

namespace graupel {
namespace {

TEST(Printable, TextStaysAndControlsBecomeQuestionMarks) {
  const std::string text = "\u00e4 \u20ac \U0001f600\nz";
  EXPECT_EQ(printable(text), text);
  EXPECT_EQ(printable("\x1b[2J\t\x7f"), "?[2J??");
  EXPECT_EQ(printable("a\u009b1m\u0080"), "a?1m?");
}

TEST(Printable, BytesThatAreNoUtf8BecomeQuestionMarks) {
  EXPECT_EQ(printable("a\x9b"
                      "1m"),
            "a?1m");                                             // C1 of terminals of 8 bits
  EXPECT_EQ(printable("\xff\xc3"), "??");                        // cut
  EXPECT_EQ(printable("\xc0\xaf|\xed\xa0\x80"), "??|???");       // overlong; a surrogate
  EXPECT_EQ(printable("\xf4\x90\x80\x80|\xe2\x82"), "????|??");  // beyond the last character; cut
}

}  // namespace
}  // namespace graupel
