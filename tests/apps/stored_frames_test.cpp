// Stored runs whose frames are not those of their scene: what reads them by number refuses them.
#include <gtest/gtest.h>

#include "tests/apps/program.h"

namespace graupel::test {
namespace {

void expect_refused(const std::string& arguments, const std::string& part) {
  const Outcome outcome = graupel(arguments);
  EXPECT_TRUE(outcome.exit_code == 2 || outcome.exit_code == 3) << arguments << ": " << outcome.output;
  EXPECT_TRUE(outcome.says(part)) << arguments << ": " << outcome.output;
}

TEST(StoredFrames, ThoseOfAStrideAreNotTheScenes) {
  const Folder folder;
  const std::string run = folder.file("strided.h5"), out = " -o " + folder.file("out.h5");
  const std::string model = "models/nsf-sand.safetensors", scene = " scenes/shared/sand_column.json";
  ASSERT_EQ(graupel("rollout " + model + scene + " --frames 24 --stride 4 -o " + run).exit_code, 0);
  const std::string part = "frames 0.06";
  expect_refused("compare --no-floors --scenes " + run + " --models mpm," + model, part);
  expect_refused("rollout models/hgn.safetensors " + run + " --frames 2" + out, part);
  expect_refused("rollout models/hgn.safetensors " + run + " --start truth:6 --frames 1" + out, part);
  if (!training_is_built()) return;
  std::filesystem::create_directory(folder.file("data"));
  std::filesystem::rename(run, folder.file("data/train.h5"));
  expect_refused("train hgn --data " + folder.file("data") + " --out " + folder.file("run"), part);
}

TEST(StoredFrames, ARunFromTheMiddleOfItsSceneIsNoTruthForMpm) {
  const Folder folder;
  const std::string whole = folder.file("whole.h5"), later = folder.file("later.h5");
  ASSERT_EQ(graupel("simulate scenes/shared/water_steps.json --frames 9 -o " + whole).exit_code, 0);
  ASSERT_EQ(graupel("rollout models/hgn.safetensors " + whole + " --start truth:6 --frames 2 -o " + later).exit_code,
            0);
  expect_refused("compare --no-floors --scenes " + later + " --models mpm", "does not begin with its scene");
}

TEST(StoredFrames, ATruthOfAModelIsSaid) {
  const Folder folder;
  const std::string run = folder.file("run.h5"), model = "models/nsf-sand.safetensors";
  ASSERT_EQ(graupel("rollout " + model + " scenes/shared/sand_column.json --frames 4 -o " + run).exit_code, 0);
  const Outcome outcome = graupel("compare --no-floors --scenes " + run + " --models " + model);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("was made by 'models/nsf-sand.safetensors', not by MPM")) << outcome.output;
}

/// A load that is refused leaves no file behind.
TEST(StoredFrames, NoneAreBegunBeforeTheLoadsAreRead) {
  const Folder folder;
  const std::string run = folder.file("run.h5");
  expect_refused("rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --load 1:2:3 -o " + run, "--load");
  EXPECT_FALSE(std::filesystem::exists(run + ".part"));
}

}  // namespace
}  // namespace graupel::test
