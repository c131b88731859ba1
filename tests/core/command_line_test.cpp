// Command lines: values of options, ranges in messages, the closest word, and words that are passed on.
#include "core/system/command_line.h"

#include <gtest/gtest.h>

namespace graupel {
namespace {

/// Exit code and standard error of a program that is given these words.
struct Answer {
  int code = 0;
  std::string said;
};

Answer answer(const CommandLine& program, std::vector<const char*> words) {
  words.insert(words.begin(), "program");
  ::testing::internal::CaptureStderr();
  const int code = program.run(static_cast<int>(words.size()), words.data(), "program");
  return {code, ::testing::internal::GetCapturedStderr()};
}

TEST(CommandLine, SetsVariablesBeforeTheCallback) {
  const CommandLine program("A program");
  program.require_command();
  const Command verb = program.command("verb", "A verb");
  int64_t number = 1, other = 5;
  std::optional<double> factor;
  std::vector<int64_t> list;
  bool given = false, other_given = false, flag = false, cleared = true, called = false;
  verb.option("-n,--number", number, "A number").check(whole_number(1)).remember_in(given);
  verb.option("--other", other, "Another").remember_in(other_given);
  verb.option("--factor", factor, "A factor").check(real_number(LowerBound::above_zero));
  verb.option("--list", list, "Several").delimiter(',');
  verb.flag("--flag", flag, "A flag");
  verb.flag("!--no-clear", cleared, "A flag");
  verb.callback([&] { called = number == 7 && factor == 2.5; });
  const Answer fine =
      answer(program, {"verb", "-n", "7", "--factor", "2.5", "--list", "1,2", "3", "--flag", "--no-clear"});
  EXPECT_EQ(fine.code, 0) << fine.said;
  EXPECT_TRUE(called && given && flag && !cleared && !other_given);
  EXPECT_EQ(other, 5);
  EXPECT_EQ(list, (std::vector<int64_t>{1, 2, 3}));
}

TEST(CommandLine, AMistakeIsAUsageErrorThatNamesTheRangeAndTheClosestWord) {
  const CommandLine program("A program");
  program.require_command();
  const Command verb = program.command("verb", "A verb");
  int64_t number = 1;
  double real = 0, bounded = 0;
  std::string word;
  verb.option("--number", number, "A number").check(whole_number(1, 4096));
  verb.option("--real", real, "A number").check(real_number(LowerBound::zero));
  verb.option("--bounded", bounded, "A number").check(real_number(0, 10));
  verb.option("--word", word, "A word").check(one_of({"f32", "f64"}));
  const struct {
    std::vector<const char*> words;
    const char* says;
  } cases[] = {{{"verb", "--number", "0"}, "'0' is not usable (allowed: a whole number, 1 to 4096)"},
               {{"verb", "--number", "3x"}, "'3x' is not usable"},
               {{"verb", "--real", "-1"}, "'-1' is not usable (allowed: a number, 0 or more)"},
               {{"verb", "--real", "inf"}, "'inf' is not usable"},
               {{"verb", "--bounded", "11"}, "(allowed: a number, 0 to 10)"},
               {{"verb", "--word", "f16"}, "f16 not in {f32,f64}"},
               {{"verb", "--nomber", "1"}, "Did you mean '--number' instead of '--nomber'?"},
               {{"verb", "--nomber", "1"}, "Run 'program verb --help' for the flags."},
               {{"verv"}, "Did you mean 'verb' instead of 'verv'?"},
               {{}, "Run 'program --help' for the flags."}};
  for (const auto& c : cases) {
    const Answer refused = answer(program, c.words);
    EXPECT_EQ(refused.code, 2) << c.says;
    EXPECT_NE(refused.said.find(c.says), std::string::npos) << refused.said;
  }
}

TEST(CommandLine, AnEmptyNameOfAFileIsNotTheDefault) {
  const CommandLine program("A program");
  std::string output = "default.h5", folder;
  std::vector<std::string> files;
  program.option("-o,--output", output, "A file").names_file({".h5"}).show_default();
  program.option("--folder", folder, "A folder").names_folder();
  program.option("files", files, "Files").names_file().names_folder();
  for (const std::vector<const char*>& words : {std::vector<const char*>{"-o", ""}, {"--folder", ""}, {"a", ""}}) {
    const Answer refused = answer(program, words);
    EXPECT_EQ(refused.code, 2) << words.front();
    EXPECT_NE(refused.said.find("is empty (allowed: the name of a file or folder)"), std::string::npos) << refused.said;
  }
  EXPECT_EQ(answer(program, {"--output="}).code, 2);  // a value is missing, says CLI11
  EXPECT_EQ(answer(program, {"-o", "a.h5", "b"}).code, 0);
}

TEST(CommandLine, PassesWordsOnAsTheyAre) {
  const CommandLine program("A program");
  const Command verb = program.command("other", "Another program");
  verb.take_words_as_they_are();
  std::vector<std::string> words;
  verb.callback([&] { words = verb.words(); });
  EXPECT_EQ(answer(program, {"other", "hgn", "--help", "--set", "a=1", "--", "-x"}).code, 0);
  ASSERT_GE(words.size(), 4U);
  EXPECT_EQ((std::vector<std::string>(words.begin(), words.begin() + 4)),
            (std::vector<std::string>{"hgn", "--help", "--set", "a=1"}));
}

}  // namespace
}  // namespace graupel
