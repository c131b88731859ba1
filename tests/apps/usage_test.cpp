// Names, words and help: what a user types and reads, and what is told before a run.
#include <gtest/gtest.h>

#include "tests/apps/child.h"

namespace graupel::test {
namespace {

TEST(Usage, TheProgramIsCalledByItsName) {
  const Folder folder;
  const std::string scene = folder.write("scene.json", small_scene());
  Child child(folder, "simulate " + scene + " --frames 100000 --threads 1 --device cpu -o " + folder.file("a.h5"));
  ASSERT_FALSE(child.ends_within(1)) << child.errors();
  EXPECT_EQ(text_of("/proc/" + std::to_string(child.process()) + "/comm"), "graupel\n");
}

TEST(Usage, SwappedArgumentsAreRecognised) {
  const Outcome outcome = graupel("rollout scenes/shared/water_steps.json models/hgn.safetensors");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("wrong order") && outcome.says("Swap them")) << outcome.output;
}

TEST(Usage, PathsWithALeadingDashFollowTwoDashes) {
  const Folder folder;
  folder.write("-x.json", small_scene());
  const auto in_folder = [&](const std::string& arguments) {
    return run_program("/bin/sh",
                       "-c 'cd " + folder.file(".") + " && " GRAUPEL_BINARY_DIR "/graupel " + arguments + "'");
  };
  EXPECT_EQ(in_folder("simulate --frames 0 -o a.h5 -- -x.json").exit_code, 0);
  EXPECT_EQ(in_folder("inspect -- -x.json").exit_code, 0);
  EXPECT_EQ(in_folder("convert -- -x.json all.json").exit_code, 0);
  const Outcome flag = in_folder("simulate -- -x.json --frames 0");
  EXPECT_EQ(flag.exit_code, 2) << flag.output;
  EXPECT_TRUE(flag.says("put flags before it")) << flag.output;
  EXPECT_FALSE(flag.says("Did you mean '--dry-run'")) << flag.output;
}

TEST(Usage, AnUnknownCommandIsNamed) {
  const Outcome unknown = graupel("frobnicate");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(unknown.says("'frobnicate' is not a command (allowed: demo, compare, ")) << unknown.output;
  const Outcome flag = graupel("--frob scene.json");
  EXPECT_EQ(flag.exit_code, 2);
  EXPECT_TRUE(flag.says("'--frob' is not a command, and flags come after one (allowed: demo")) << flag.output;
}

TEST(Usage, HelpTellsTheExitCodes) {
  const Outcome help = graupel("--help");
  for (const char* words : {"2 wrong flags, or values in scenes", "3 input files that are missing",
                            "5 an output cannot be written", "130 stopped by Ctrl-C"})
    EXPECT_TRUE(help.says(words)) << words << "\n" << help.output;
}

TEST(Usage, TheDemoFindsItsFilesFromEverywhere) {
  const Outcome help = run_program("/bin/sh", "-c 'cd / && " GRAUPEL_BINARY_DIR "/graupel demo --help'");
  EXPECT_TRUE(help.says(GRAUPEL_SOURCE_DIR "/models") && help.says(GRAUPEL_SOURCE_DIR "/scenes/shared")) << help.output;
}

TEST(Usage, InspectTellsWhatIsNotThereAndWhatAFolderHolds) {
  const Folder folder;
  for (const char* name : {"none", "none.json", "none.h5"}) {
    const Outcome missing = graupel("inspect " + folder.file(name));
    EXPECT_EQ(missing.exit_code, 3) << missing.output;
    EXPECT_TRUE(missing.says("is not there")) << missing.output;
  }
  const Outcome empty = graupel("inspect " + folder.file("."));
  EXPECT_EQ(empty.exit_code, 3) << empty.output;
  EXPECT_EQ(graupel("inspect " + folder.write("note.txt", "x")).exit_code, 3);
  const Outcome floors = graupel("inspect scenes/floors/demo.json");
  EXPECT_EQ(floors.exit_code, 0) << floors.output;
  EXPECT_TRUE(floors.says("kind: chaos floors")) << floors.output;
  EXPECT_TRUE(empty.says("dataset.json")) << empty.output;
  for (const char* recipe : {"hgn", "general"}) {
    const Outcome outcome = graupel(std::string("inspect scenes/recipes/") + recipe + ".json");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_TRUE(outcome.says("kind: recipe") && outcome.says("train: ")) << outcome.output;
  }
}

TEST(Usage, DefaultsAreThoseOfNoScene) {
  for (const char* words : {"scenes/shared/water_steps.json", "--set domain.dx=0.02"}) {
    const Outcome outcome = graupel(std::string("simulate --print-defaults ") + words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    EXPECT_TRUE(outcome.says(words) && outcome.says("Leave out")) << outcome.output;
  }
}

/// An estimate runs no frame.
TEST(Usage, ADryRunIsShortWhateverTheSceneAsksFor) {
  const Folder folder;
  const std::string scene = folder.write("scene.json", small_scene()),
                    arguments = "simulate " + scene +
                                " --dry-run --threads 1 --device cpu --set "
                                "time_step.policy=fixed --set time_step.substeps_per_frame=";
  for (const char* substeps : {"54", "1000000"}) {
    const Outcome outcome = graupel(arguments + substeps);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const std::size_t at = outcome.output.find("(from ");
    ASSERT_NE(at, std::string::npos) << outcome.output;
    EXPECT_LE(std::atoi(outcome.output.c_str() + at + 6), 20) << outcome.output;
  }
}

TEST(Usage, InspectAndADryRunRefuseWhatSimulateRefuses) {
  const Folder folder;
  const std::string scene = folder.write("scene.json", small_scene());
  for (const char* change : {"gravity=[0,-1e308,0]", "frame_time=1e300", "sources.0.position=[5,5,5]",
                             "sources.0.position=[1e308,0.5,0.5]"}) {
    const std::string set = std::string(" --set ") + change;
    const Outcome run = graupel("simulate " + scene + set + " --device cpu --frames 1 -o " + folder.file("a.h5"));
    const Outcome dry = graupel("simulate --dry-run --device cpu " + scene + set);
    EXPECT_NE(run.exit_code, 0) << change;
    EXPECT_EQ(dry.exit_code, run.exit_code) << change << "\n" << dry.output;
    EXPECT_EQ(dry.output, run.output);
  }
  const std::string far =
      folder.write("far.json", small_scene("",
                                           "{ \"shape\": \"box\", \"size\": [0.1, 0.1, 0.1], \"position\": [5, 5, 5], "
                                           "\"material\": \"water\" }"));
  const Outcome inspect = graupel("inspect " + far), validate = graupel("validate " + far);
  EXPECT_EQ(inspect.exit_code, 2) << inspect.output;
  EXPECT_TRUE(inspect.says("outside the walls")) << inspect.output;
  EXPECT_TRUE(validate.says("outside the walls")) << validate.output;
  const Outcome fine = graupel("inspect " + folder.write("fine.json", small_scene(R"("obstacle_voxel": 1e-4,
    "obstacles": [ { "shape": "box", "size": [0.4, 0.1, 0.4], "position": [0.5, 0.1, 0.5] } ])")));
  EXPECT_EQ(fine.exit_code, 2) << fine.output;
  EXPECT_TRUE(fine.says("obstacle_0_box needs too many blocks")) << fine.output;
  const Outcome gravity =
      graupel("inspect " + folder.write("heavy.json", small_scene("  \"gravity\": [0, -1e308, 0]")));
  EXPECT_EQ(gravity.exit_code, 2) << gravity.output;
  EXPECT_TRUE(gravity.says("/gravity") && gravity.says("1e+06")) << gravity.output;
}

}  // namespace
}  // namespace graupel::test
