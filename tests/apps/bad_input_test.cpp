// Bad input ends with a message that names the file, the place, the value and the remedy, and with the right exit code.
#include <gtest/gtest.h>

#include <sys/mount.h>

#include <fstream>
#include <iterator>

#include "core/parallel/device.h"
#include "core/system/atomic_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

TEST(BadInput, BrokenJsonNamesLineAndColumn) {
  const Folder folder;
  const auto scene = folder.write("broken.json", "{\n  \"name\": \"x\",\n  \"frames\": 12,,\n}\n");
  const Outcome outcome = graupel("simulate " + scene + " -o " + folder.file("a.h5"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("broken.json:3:16: ")) << outcome.output;  // the second comma
}

TEST(BadInput, TextAfterANulByteIsNotPassedOver) {
  const Folder folder;
  const std::string text = small_scene("") + std::string("\0{ \"frames\": broken", 19);
  const Outcome outcome = graupel("validate " + folder.write("nul.json", text));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("a NUL byte")) << outcome.output;
  const auto named =
      folder.write("name.json", small_scene(R"("obstacles": [{ "shape": "mesh", "file": "a.obj\u0000.ply" }])"));
  const Outcome in_name = graupel("validate " + named);
  EXPECT_EQ(in_name.exit_code, 3) << in_name.output;
  EXPECT_TRUE(in_name.says("/obstacles/0/file holds the character NUL")) << in_name.output;
}

TEST(BadInput, PathsThatTheSystemRefusesAreNamed) {
  const Folder folder;
  const std::string name(256, 'x');
  const auto scene =
      folder.write("long.json", small_scene(R"("obstacles": [{ "shape": "mesh", "file": ")" + name + R"(.obj" }])"));
  const Outcome geometry = graupel("simulate " + scene);
  EXPECT_EQ(geometry.exit_code, 3) << geometry.output;
  EXPECT_TRUE(geometry.says("/obstacles/0/file")) << geometry.output;
  const auto good = folder.write("good.json", small_scene(""));
  const Outcome output = graupel("simulate " + good + " --frames 1 -o " + folder.file(std::string(250, 'x') + ".h5"));
  EXPECT_EQ(output.exit_code, 5) << output.output;
  EXPECT_TRUE(output.says("Choose a shorter name")) << output.output;
  const std::string gone = folder.file("gone");
  const Outcome nowhere = run_program("/bin/sh", "-c 'mkdir " + gone + " && cd " + gone + " && rmdir " + gone +
                                                     " && " GRAUPEL_BINARY_DIR "/graupel simulate " + good + "'");
  EXPECT_EQ(nowhere.exit_code, 5) << nowhere.output;
  EXPECT_TRUE(nowhere.says("Choose another folder")) << nowhere.output;
}

TEST(BadInput, TextOfFilesDoesNotSteerTheTerminal) {
  const Folder folder;
  const std::string file = folder.write("escape.json", "{ \"\\u001b[31mred\\u009b2J\\u0007\": 1 }");
  for (const char* verb : {"simulate ", "validate ", "inspect "}) {
    const Outcome outcome = graupel(verb + file);
    EXPECT_TRUE(outcome.says("?[31mred?2J?")) << outcome.output;
    EXPECT_EQ(outcome.output.find('\x1b'), std::string::npos) << verb;
    EXPECT_EQ(outcome.output.find('\x07'), std::string::npos) << verb;
    EXPECT_EQ(outcome.output.find("\xc2\x9b"), std::string::npos) << verb;
  }
}

TEST(BadInput, UnknownKeyIsAnsweredWithTheClosestOne) {
  const Folder folder;
  const auto scene = folder.write("typo.json", small_scene("  \"gravitty\": [0, -9.8, 0]"));
  const Outcome outcome = graupel("simulate " + scene);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("gravitty") && outcome.says("Did you mean 'gravity'")) << outcome.output;
  EXPECT_TRUE(outcome.says("typo.json:7")) << outcome.output;
}

TEST(BadInput, NegativeSizeNamesPointerValueAndRange) {
  const Folder folder;
  const auto scene = folder.write(
      "negative.json",
      small_scene(
          "", "{ \"shape\": \"sphere\", \"radius\": -0.1, \"position\": [0.5, 0.5, 0.5], \"material\": \"water\" }"));
  const Outcome outcome = graupel("simulate " + scene);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("/sources/0/radius") && outcome.says("-0.1") && outcome.says("> 0")) << outcome.output;
}

TEST(BadInput, SourceInsideAnObstacleNamesBoth) {
  const Folder folder;
  const auto scene = folder.write(
      "inside.json",
      small_scene("  \"obstacles\": [{ \"shape\": \"sphere\", \"radius\": 0.2, \"position\": [0.5, 0.5, 0.5] }]"));
  const Outcome outcome = graupel("simulate " + scene + " -o " + folder.file("a.h5"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("source 0") && outcome.says("obstacle 0")) << outcome.output;
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.h5")));
}

TEST(BadInput, MissingMeshNamesTheResolvedPath) {
  const Folder folder;
  const auto scene =
      folder.write("mesh.json", small_scene("  \"obstacles\": [{ \"shape\": \"mesh\", \"file\": \"none.obj\" }]"));
  const Outcome outcome = graupel("simulate " + scene);
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_TRUE(outcome.says(folder.file("none.obj")) && outcome.says("/obstacles/0/file")) << outcome.output;
}

TEST(BadInput, AMeshOnTooFineAGridIsRefusedAtOnce) {
  for (const char* set : {"obstacle_voxel=1e-4", "obstacle_band=1e9"}) {
    const Outcome outcome = graupel("simulate scenes/shared/mixed_torus.json --dry-run --set " + std::string(set));
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    EXPECT_TRUE(outcome.says("too large for its grid") && outcome.says("obstacle_voxel")) << outcome.output;
  }
}

/// ulimit -f counts blocks of 512 or 1,024 bytes.
TEST(BadInput, ALimitOnFileSizesIsAnErrorOfWriting) {
  const Folder folder;
  const std::string scene = folder.write("scene.json", small_scene(""));
  const Outcome outcome = run_program("/bin/sh", "-c 'ulimit -f 8; exec " GRAUPEL_BINARY_DIR "/graupel simulate " +
                                                     scene + " --frames 40 -o " + folder.file("a.h5") + "'");
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("cannot")) << outcome.output;
}

TEST(BadInput, ARecipeWithTooManyCellsIsRefused) {
  const Folder folder;
  const Outcome outcome = graupel("generate scenes/recipes/hgn.json -o " + folder.file("d") +
                                  " --set domain.size=[1e30,1,1] --set counts.train=1");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("too many cells")) << outcome.output;
}

TEST(BadInput, MissingSceneAndUnknownFlagAndVerb) {
  EXPECT_EQ(graupel("simulate no-such-scene.json").exit_code, 3);
  const Outcome flag = graupel("simulate scenes/shared/water_steps.json --frmes 3");
  EXPECT_EQ(flag.exit_code, 2);
  EXPECT_TRUE(flag.says("--frames")) << flag.output;
  const Outcome verb = graupel("simulte scenes/shared/water_steps.json");
  EXPECT_EQ(verb.exit_code, 2);
  EXPECT_TRUE(verb.says("simulate")) << verb.output;
}

TEST(BadInput, NumbersOutOfRangeAreAnsweredInOneLine) {
  const Outcome frames = graupel("simulate scenes/shared/water_steps.json --frames -3");
  EXPECT_EQ(frames.exit_code, 2);
  EXPECT_TRUE(frames.says("'-3'") && frames.says("0 or more")) << frames.output;
  EXPECT_LT(frames.output.size(), 200u) << frames.output;
  const Outcome text = graupel("compare --scenes scenes/shared --models mpm --frames 2.5");
  EXPECT_EQ(text.exit_code, 2);
  EXPECT_TRUE(text.says("whole number")) << text.output;
  const Outcome minutes = graupel("generate scenes/recipes/hgn.json -o /dev/null/x --minutes -0.5");
  EXPECT_EQ(minutes.exit_code, 2);
  EXPECT_TRUE(minutes.says("'-0.5'") && minutes.says("a number, 0 or more")) << minutes.output;
  const Outcome threads = graupel("demo --threads -5");
  EXPECT_EQ(threads.exit_code, 2);
  EXPECT_TRUE(threads.says("0 to 4096")) << threads.output;
}

TEST(BadInput, SeedsAreWholeNumbers) {
  for (const char* seed : {"-1", "1.5", "18446744073709551616", "x"}) {
    const Outcome outcome = graupel("simulate scenes/shared/water_steps.json --dry-run --seed " + std::string(seed));
    EXPECT_EQ(outcome.exit_code, 2) << seed;
    EXPECT_TRUE(outcome.says("0 to 2^64 - 1")) << outcome.output;
  }
  EXPECT_EQ(graupel("simulate scenes/shared/water_steps.json --dry-run --seed 18446744073709551615").exit_code, 0);
}

/// Names of files are bytes; JSON is UTF-8.
TEST(BadInput, NamesOfFilesThatAreNoTextGetTheirJson) {
  const Folder folder;
  const std::string json = folder.file("a.json");
  const Outcome outcome =
      graupel("simulate scenes/shared/water_steps.json --frames 0 -o '" + folder.file("o\xff.h5") + "' --json " + json);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_NE(read_file(json).find("o\xef\xbf\xbd.h5"), std::string::npos);
}

TEST(BadInput, VerbsTakeTheFlagsThatMeanSomething) {
  for (const char* verb : {"demo", "compare", "generate", "simulate", "rollout", "view"}) {
    const Outcome help = graupel(std::string(verb) + " --help");
    for (const char* flag : {"--seed", "--device", "--threads", "--json"})
      EXPECT_TRUE(help.says(flag)) << verb << " " << flag;
  }
  for (const char* verb : {"export", "inspect", "validate", "doctor"}) {
    const Outcome help = graupel(std::string(verb) + " --help");
    for (const char* flag : {"--threads", "--json"}) EXPECT_TRUE(help.says(flag)) << verb << " " << flag;
    for (const char* flag : {"--seed", "--device"}) EXPECT_FALSE(help.says(flag)) << verb << " " << flag;
    EXPECT_EQ(graupel(std::string(verb) + " x.h5 --seed 1").exit_code, 2) << verb;
  }
}

TEST(BadInput, UnwritableResultsAreFoundBeforeTheWork) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const Outcome json = graupel("simulate " + scene + " -o " + folder.file("a.h5") + " --json " + folder.file("no/x"));
  EXPECT_EQ(json.exit_code, 5);
  EXPECT_TRUE(json.says(folder.file("no"))) << json.output;
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.h5")));
  EXPECT_EQ(graupel("rollout models/hgn.safetensors " + scene + " -o " + folder.file("no/a.h5")).exit_code, 5);
  EXPECT_EQ(graupel("demo -o " + folder.file("no/report.html")).exit_code, 5);
}

TEST(BadInput, RolloutRefusesFlagsThatMeanNothing) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const std::string rollout = "rollout models/hgn.safetensors ", out = " -o " + folder.file("b.h5");
  if (!cuda_available()) {
    const Outcome cuda = graupel(rollout + scene + out + " --device cuda");
    EXPECT_EQ(cuda.exit_code, 2);
    EXPECT_TRUE(cuda.says("cuda")) << cuda.output;
  }
  EXPECT_EQ(graupel(rollout + scene + out + " --trajectory 1").exit_code, 2);
  ASSERT_EQ(graupel("simulate " + scene + " --frames 1 -o " + folder.file("a.h5")).exit_code, 0);
  const Outcome seed = graupel(rollout + folder.file("a.h5") + out + " --seed 3");
  EXPECT_EQ(seed.exit_code, 2);
  EXPECT_TRUE(seed.says("--seed")) << seed.output;
  const Outcome index = graupel(rollout + folder.file("a.h5") + out + " --trajectory 1");
  EXPECT_EQ(index.exit_code, 2);
  EXPECT_TRUE(index.says("allowed: 0 to 0")) << index.output;
}

TEST(BadInput, TruncatedTrajectory) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  ASSERT_EQ(graupel("simulate " + scene + " -o " + folder.file("a.h5")).exit_code, 0);
  std::ifstream in(folder.file("a.h5"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  const auto cut = folder.write("cut.h5", bytes.substr(0, bytes.size() / 2));
  const Outcome outcome = graupel("inspect " + cut);
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("cut.h5")) << outcome.output;
  EXPECT_EQ(graupel("export " + folder.write("text.h5", "not HDF5 at all")).exit_code, 3);
}

TEST(BadInput, DamagedWeights) {
  const Folder folder;
  const Outcome magic =
      graupel("inspect " + folder.write("magic.safetensors", "PK\x03\x04 this is a zip file, not safetensors"));
  EXPECT_EQ(magic.exit_code, 3);
  EXPECT_TRUE(magic.says("magic.safetensors")) << magic.output;
  std::ifstream in(GRAUPEL_SOURCE_DIR "/models/hgn.safetensors", std::ios::binary);
  ASSERT_TRUE(in) << "models/hgn.safetensors is missing";
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  const auto cut = folder.write("cut.safetensors", bytes.substr(0, bytes.size() - 100));
  const Outcome truncated = graupel("rollout " + cut + " scenes/shared/water_steps.json");
  EXPECT_EQ(truncated.exit_code, 3) << truncated.output;
  EXPECT_TRUE(truncated.says("cut.safetensors")) << truncated.output;
}

TEST(BadInput, WeightsOfAnotherArchitecture) {
  const Folder folder;
  const std::string header =
      R"({"__metadata__":{"architecture":"segnn","format_version":"1"},"w":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})";
  std::string bytes(8, '\0');
  for (int i = 0; i < 8; ++i) bytes[static_cast<std::size_t>(i)] = static_cast<char>(header.size() >> (8 * i) & 255);
  const auto file = folder.write("other.safetensors", bytes + header + std::string(4, '\0'));
  const Outcome outcome = graupel("rollout " + file + " scenes/shared/water_steps.json");
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_TRUE(outcome.says("segnn") && outcome.says("gns") && outcome.says("hgn")) << outcome.output;
}

TEST(BadInput, OutputFolderNotWritable) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const Outcome outcome = graupel("simulate " + scene + " -o /proc/no/such/place.h5");
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("/proc/no/such/place.h5")) << outcome.output;
}

TEST(BadInput, DiskFull) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const std::string mount_point = folder.file("tiny");
  std::filesystem::create_directory(mount_point);
  if (::mount("tmpfs", mount_point.c_str(), "tmpfs", 0, "size=64k") != 0)
    GTEST_SKIP() << "no tmpfs can be mounted here (needs root): disk-full is not tested";
  const Outcome outcome = graupel("simulate " + scene + " -o " + mount_point + "/a.h5 --frames 40");
  const bool left = std::filesystem::exists(mount_point + "/a.h5");
  ::umount(mount_point.c_str());
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("a.h5")) << outcome.output;
  EXPECT_FALSE(left) << "a truncated file took the finished one's name";
}

TEST(BadInput, WhatIsWrongWithASceneNamesItsFileThePointerTheValueAndARemedy) {
  const Folder folder;
  const auto source = [](const std::string& keys) {
    return "{ \"shape\": \"box\", \"size\": [0.15, 0.15, 0.15], \"position\": [0.5, 0.5, 0.5], \"material\": "
           "\"water\", " +
           keys + " }";
  };
  const std::string emitter =
      "  \"emitters\": [{ \"shape\": \"box\", \"size\": [0.1, 0.1, 0.1], \"position\": [0.3, 0.8, 0.3], \"material\": "
      "\"water\", \"velocity\": [0, -5, 0], \"end_time\": ";
  struct Case {
    std::string name, scene;
    std::vector<std::string> says;
  };
  const std::vector<Case> cases = {
      {"far",
       small_scene("",
                   "{ \"shape\": \"box\", \"size\": [0.15, 0.15, 0.15], \"position\": [5, 5, 5], \"material\": "
                   "\"water\" }"),
       {"/sources/0", "outside the walls", "allowed: (0.09375", "Move or shrink it"}},
      {"many",
       small_scene("", source("\"particles_per_cell\": 1e9")),
       {"/sources/0/particles_per_cell", "1e+09", "<= 1000", "Change the value"}},
      {"runaway",
       small_scene(emitter + "1e6 }]"),
       {"/emitters/0", "15680000000", "particle_limit: 1000000", "end the emission earlier"}},
  };
  for (const Case& c : cases) {
    const auto file = folder.write(c.name + ".json", c.scene);
    const Outcome outcome = graupel("simulate " + file + " -o " + folder.file("a.h5"));
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    EXPECT_TRUE(outcome.says(c.name + ".json")) << outcome.output;
    for (const std::string& part : c.says) EXPECT_TRUE(outcome.says(part)) << part << " is not in: " << outcome.output;
    EXPECT_FALSE(std::filesystem::exists(folder.file("a.h5")));
  }
}

TEST(BadInput, AFixedStepThatBlowsUpSuggestsOne) {
  const Folder folder;
  const auto scene = folder.write("stiff.json", small_scene("  \"time_step\": { \"policy\": \"fixed\", "
                                                            "\"substeps_per_frame\": 1 },\n  \"frame_time\": 0.05"));
  const std::string hint = "substeps_per_frame ";
  int substeps = 1;
  // Following what it suggests, at most a step of an eighth at a time, soon ends in a run.
  for (int attempt = 0; attempt < 5; ++attempt) {
    const Outcome run =
        graupel("simulate " + scene + " --set time_step.substeps_per_frame=" + std::to_string(substeps) + " -o " +
                folder.file("a.h5"));
    if (attempt > 0 && run.exit_code == 0) return;
    EXPECT_EQ(run.exit_code, 4) << run.output;
    EXPECT_TRUE(run.says("diverged at particle")) << run.output;
    const std::size_t at = run.output.find(hint);
    ASSERT_NE(at, std::string::npos) << run.output;
    const int suggested = std::atoi(run.output.c_str() + at + hint.size());
    EXPECT_GT(suggested, substeps);
    substeps = suggested;
  }
  ADD_FAILURE() << substeps << " substeps a frame still diverge";
}

TEST(BadInput, ASceneThatCannotFitIsRefusedAtOnce) {
  const Folder folder;
  const auto scene = folder.write("fine.json", small_scene("",
                                                           "{ \"shape\": \"box\", \"size\": [0.5, 0.5, 0.5], "
                                                           "\"position\": [0.5, 0.5, 0.5], \"material\": \"water\", "
                                                           "\"particles_per_cell\": 1000 }"));
  for (const char* verb : {"simulate ", "simulate --dry-run "}) {
    const Outcome outcome = graupel(verb + scene + " --device cpu --set domain.dx=0.0005");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    for (const char* part : {"fine.json", "memory of the CPU", "GB needed for 1000000000000 particles", "GB available",
                             "fewer particles_per_cell, a larger dx"})
      EXPECT_TRUE(outcome.says(part)) << part << " is not in: " << outcome.output;
  }
}

TEST(BadInput, DivergedRunExitsWithFourAndKeepsTheBadState) {
  const Folder folder;
  const auto scene = folder.write(
      "stiff.json",
      small_scene("  \"time_step\": { \"policy\": \"fixed\", \"substeps_per_frame\": 1 },\n  \"frame_time\": 0.05"));
  const Outcome outcome = graupel("simulate " + scene + " -o " + folder.file("a.h5"));
  EXPECT_EQ(outcome.exit_code, 4) << outcome.output;
  EXPECT_TRUE(outcome.says("particle") && outcome.says("water")) << outcome.output;
  EXPECT_EQ(graupel("inspect " + folder.file("a.h5")).exit_code, 0);
  EXPECT_EQ(graupel("inspect " + folder.file("a.h5.blowup.h5")).exit_code, 0);
}

}  // namespace
}  // namespace graupel::test
