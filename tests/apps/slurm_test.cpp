// Slurm: a task's place in its array, bad values of its variables, and scripts for submission.
#include <gtest/gtest.h>

#include "tests/apps/program.h"

namespace graupel::test {
namespace {

const std::string recipe = "scenes/recipes/hgn.json";

/// generate --shard slurm with these variables; the data set is that of no scene.
Outcome in_array(const std::string& variables) {
  const Folder folder;
  return run_program("/usr/bin/env", "-u SLURM_ARRAY_TASK_ID " + variables +
                                         " " GRAUPEL_BINARY_DIR "/graupel generate " + recipe +
                                         " --shard slurm --set counts.train=1 --set counts.valid=0 --set counts.test=0 "
                                         "--set frames=1 --set domain.dx=0.05 -o " +
                                         folder.file("data"));
}

std::string array(const std::string& id, const std::string& count, const std::string& low, const std::string& high,
                  const std::string& step = "1") {
  return "SLURM_ARRAY_TASK_ID=" + id + " SLURM_ARRAY_TASK_COUNT=" + count + " SLURM_ARRAY_TASK_MIN=" + low +
         " SLURM_ARRAY_TASK_MAX=" + high + " SLURM_ARRAY_TASK_STEP=" + step;
}

TEST(Slurm, ATaskFindsItsShard) {
  EXPECT_TRUE(in_array(array("3", "8", "0", "7")).says("array 0-7 makes shard 3/8"));
  EXPECT_TRUE(in_array(array("3", "8", "1", "8")).says("array 1-8 makes shard 2/8"));
  EXPECT_TRUE(in_array(array("9", "4", "3", "12", "3")).says("array 3-12 makes shard 2/4"));
}

TEST(Slurm, BadVariablesAreNamed) {
  const auto refused = [](const std::string& variables, const std::string& text) {
    const Outcome outcome = in_array(variables);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    EXPECT_TRUE(outcome.says(text)) << outcome.output;
  };
  refused("", "SLURM_ARRAY_TASK_ID is not set");
  refused("SLURM_ARRAY_TASK_ID=2", "SLURM_ARRAY_TASK_MIN is missing");
  refused("SLURM_ARRAY_TASK_ID=2 SLURM_ARRAY_TASK_MIN=0 SLURM_ARRAY_TASK_MAX=3", "SLURM_ARRAY_TASK_COUNT is missing");
  refused(array("two", "8", "0", "7"), "SLURM_ARRAY_TASK_ID='two' is not usable");
  refused(array("2", "0", "0", "7"), "SLURM_ARRAY_TASK_COUNT='0' is not usable");
  refused(array("2", "3", "1", "7"), "has no place among its 3 tasks");
}

TEST(Slurm, TheScriptCarriesEveryWordThroughTheShell) {
  const Folder folder;
  const Outcome script = graupel("generate " + recipe + " --emit-slurm 3 --seed=4 --json 'a b.json' -o \"" +
                                 folder.file("it's") + " \\$HOME\"");
  ASSERT_EQ(script.exit_code, 0) << script.output;
  EXPECT_TRUE(script.says("--array=0-2")) << script.output;
  EXPECT_TRUE(script.says("it'\\''s $HOME'")) << script.output;
  EXPECT_EQ(script.output.find("--json 'a b.json'"), script.output.rfind("--json 'a b.json'"));  // of the merge alone
  EXPECT_FALSE(script.says("--emit-slurm"));
  const Outcome lines = graupel("generate " + recipe + " --emit-slurm 3 -o 'a\nEND_OF_JOB\nb'");
  EXPECT_TRUE(lines.says("<< 'END_OF_JOB_'\n") && lines.says("\nEND_OF_JOB_\n)")) << lines.output;
  const std::string marked = folder.file("a@COMMAND@b@END@@");
  std::filesystem::create_directory(marked);
  const Outcome marks = run_program("/usr/bin/env", "-C " + marked + " " GRAUPEL_BINARY_DIR "/graupel generate " +
                                                        GRAUPEL_SOURCE_DIR "/" + recipe + " --emit-slurm 3 -o x");
  EXPECT_TRUE(marks.says("\ncd " + marked + " || exit 1\nexec ${GRAUPEL:-")) << marks.output;
  // Where there is no sbatch the script says so and does nothing.
  const std::string file = folder.write("submit.sh", script.output);
  const Outcome none = run_program("/usr/bin/env", "PATH=" + folder.file("") + " /bin/bash " + file);
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_TRUE(none.says("sbatch is not there")) << none.output;
  EXPECT_EQ(graupel("generate " + recipe + " -o x --emit-slurm 3 --shard 0/2").exit_code, 2);
  EXPECT_EQ(graupel("generate no_recipe.json -o x --emit-slurm 3").exit_code, 3);
}

}  // namespace
}  // namespace graupel::test
