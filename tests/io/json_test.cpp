#include <gtest/gtest.h>

#include <cstring>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/config/json_node.h"

namespace graupel::io {
namespace {

TEST(Json, KeepsLinesOrderAndComments) {
  const JsonNode root =
      parse_json("{ // a comment\n\"b\": 1, /* two\nlines */ \"a\": [2,\n3.5]\n, \"c\": -7}", "t.json");
  ASSERT_EQ(root.members.size(), 3u);
  EXPECT_EQ(root.members[0].key, "b");
  EXPECT_EQ(root.members[0].value.line, 2);
  EXPECT_EQ(root.find("a")->line, 3);
  EXPECT_EQ(root.find("a")->items[0].line, 3);
  EXPECT_EQ(root.find("a")->items[1].line, 4);
  EXPECT_EQ(root.find("c")->line, 5);
  EXPECT_EQ(root.find("c")->as_double(), -7);
}

TEST(Json, WritesNumbersThatReadBackToTheSameBits) {
  for (const double value : {0.1, 1.0 / 64, 1e-310, 1.7976931348623157e308, -0.0, 3.0}) {
    const JsonNode back = parse_json(write_json(JsonNode::of(value), JsonLayout::compact), "t");
    const double read = back.as_double();
    EXPECT_EQ(std::memcmp(&read, &value, sizeof value), 0) << value;
  }
  EXPECT_EQ(write_json(JsonNode::of(~uint64_t(0)), JsonLayout::compact), "18446744073709551615");
  EXPECT_EQ(write_json(JsonNode::of(INT64_MIN), JsonLayout::compact), "-9223372036854775808");
  EXPECT_EQ(parse_json("-9223372036854775808", "t").magnitude, uint64_t(1) << 63);
}

TEST(Json, EscapesText) {
  const std::string text = "a \"quote\", a \\, a tab\t, a line\nand \x01";
  EXPECT_EQ(parse_json(write_json(JsonNode::of(text), JsonLayout::compact), "t").text, text);
}

TEST(Json, NamesFileLineAndColumnOfSyntaxErrors) {
  expect_error<InputError>([] { parse_json("{\n  \"a\": 1,\n  \"b\" 2\n}", "bad.json"); },
                           {"bad.json:3:7: ", "not valid JSON"});
  expect_error<InputError>([] { parse_json("{\"a\": [1, 2}", "bad.json"); }, {"bad.json:1:12: "});
  expect_error<InputError>([] { parse_json("", "bad.json"); }, {"bad.json:1:1: "});
  expect_error<InputError>([] { parse_json("{\"a\": 1} x", "bad.json"); }, {"bad.json:1:10: "});
  expect_error<InputError>([] { parse_json("{\"a\": 1e999}", "bad.json"); }, {"bad.json:1:", "1e999"});
  expect_error<InputError>([] { parse_json("{\"a\": NaN}", "bad.json"); }, {"bad.json:1:7: "});
  expect_error<InputError>([] { parse_json("{\"a\": \"\xff\"}", "bad.json"); }, {"bad.json:1:", "UTF-8"});
}

TEST(Json, TakesUtf8sByteOrderMarkAndNamesOtherEncodings) {
  EXPECT_EQ(parse_json("\xef\xbb\xbf{\"a\": 7}", "a.json").find("a")->as_double(), 7);
  const std::string wide("\xff\xfe{\0}\0", 6), big_endian("\xfe\xff\0{\0}", 6);
  for (const std::string& text : {wide, big_endian})
    expect_error<InputError>([&] { parse_json(text, "a.json"); },
                             {"a.json", "is UTF-16 by its byte order mark", "Save it as UTF-8"});
}

TEST(Json, RefusesRepeatedKeysDepthAndSize) {
  expect_error<ConfigError>([] { parse_json("{\"a\": 1,\n \"a\": 2}", "bad.json"); },
                            {"bad.json:2:", "'a' is given twice"});
  expect_error<ConfigError>([] { parse_json(std::string(65, '[') + std::string(65, ']'), "bad.json"); },
                            {"bad.json:1:65: ", "at most 64"});
  EXPECT_NO_THROW(parse_json(std::string(64, '[') + std::string(64, ']'), "good.json"));
  expect_error<ConfigError>([] { parse_json(std::string((16 << 20) + 1, ' '), "big.json"); },
                            {"big.json", "16777217 bytes", "at most 16777216"});
}

TEST(Json, SurvivesEveryTruncation) {
  const std::string text = "{\"a\": [1, -2.5e3, true, null, \"x\\n\"], /* c */ \"b\": {\"c\": {}}}";
  for (std::size_t n = 0; n < text.size(); ++n) EXPECT_THROW(parse_json(text.substr(0, n), "cut"), InputError) << n;
}

}  // namespace
}  // namespace graupel::io
