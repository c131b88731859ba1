// graupel bench: the program beside it, and what is said where that is missing.
#include <gtest/gtest.h>

#include "tests/apps/program.h"

namespace graupel::test {
namespace {

TEST(BenchAlias, StartsTheProgramBesideItWithTheSameWords) {
  const Folder folder;
  std::filesystem::copy_file(GRAUPEL_BINARY_DIR "/graupel", folder.file("graupel"));
  const std::string beside = folder.write("graupel-bench", "#!/bin/sh\nprintf '[%s]' \"$@\"\nexit 7\n");
  std::filesystem::permissions(beside, std::filesystem::perms::owner_all);
  const Outcome outcome = run_program(folder.file("graupel"), "bench mpm --material sand --help 'two words'");
  EXPECT_EQ(outcome.exit_code, 7);
  EXPECT_EQ(outcome.output, "[mpm][--material][sand][--help][two words]");
}

TEST(BenchAlias, SaysHowToBuildTheProgram) {
  const Folder folder;
  std::filesystem::copy_file(GRAUPEL_BINARY_DIR "/graupel", folder.file("graupel"));
  const Outcome outcome = run_program(folder.file("graupel"), "bench validate --list");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("graupel-bench' is not there") && outcome.says("-DGRAUPEL_BENCH=ON")) << outcome.output;
}

}  // namespace
}  // namespace graupel::test
