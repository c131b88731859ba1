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

TEST(Printable, LongTextIsShortenedBetweenCharacters) {
  EXPECT_EQ(shortened("0123456789", 10), "0123456789");
  EXPECT_EQ(shortened("0123456789a", 10), "0123456789...");
  EXPECT_EQ(shortened("ab\u20acd", 4), "ab...");
  EXPECT_EQ(shortened("\x80\x80\x80", 2), "...");
}

TEST(Printable, MessagesKeepTheirBeginAndTheirRemedy) {
  const std::string message = "'file' is bad (" + std::string(100000, 'x') + "\x1b). Make it again";
  const std::string shown = message_text(message);
  EXPECT_LT(shown.size(), 4000u);
  EXPECT_TRUE(shown.starts_with("'file' is bad (xxx"));
  EXPECT_NE(shown.find("x... x"), std::string::npos);
  EXPECT_TRUE(shown.ends_with("x?). Make it again"));
  EXPECT_EQ(message_text("short\x07"), "short?");
}

}  // namespace
}  // namespace graupel
