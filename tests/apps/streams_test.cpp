// What verbs print: a full disk is an error, JSON is alone, and text of files is no command to the terminal.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/trajectory/trajectory_file.h"
#include "tests/apps/child.h"

namespace graupel::test {
namespace {

using Json = nlohmann::json;

class Streams : public ::testing::Test {
 protected:
  /// Standard output as JSON, with nothing beside it.
  Json json_of(const std::string& arguments) const {
    Child child(folder_, arguments + " --json -");
    EXPECT_TRUE(child.ends_within(120)) << arguments;
    EXPECT_EQ(child.exit_code(), 0) << arguments << "\n" << child.errors();
    const Json result = Json::parse(child.output(), nullptr, false);
    EXPECT_TRUE(result.is_object()) << arguments << " printed\n" << child.output();
    return result;
  }

  Folder folder_;
  std::string scene_ = folder_.write("scene.json", small_scene());
};

TEST_F(Streams, AFullStandardOutputIsAnErrorOfWriting) {
  for (const std::string& arguments :
       {std::string("--help"), std::string("simulate --help"), std::string("--version"), std::string("convert --help"),
        std::string("simulate --print-defaults"), "inspect " + scene_, "simulate --dry-run " + scene_,
        "validate " + scene_, std::string("doctor --threads 1"), "inspect --json - " + scene_,
        "compare --scenes " + scene_ + " --models mpm --no-floors --frames 1 --threads 1",
        "convert " + scene_ + " -"}) {
    const Outcome outcome = run_program("/bin/sh", "-c '" GRAUPEL_BINARY_DIR "/graupel " + arguments + " > /dev/full'");
    EXPECT_EQ(outcome.exit_code, 5) << arguments << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("standard output") && (outcome.says("No space left") || outcome.says("full disk")))
        << arguments << "\n"
        << outcome.output;
  }
}

TEST_F(Streams, AClosedStandardOutputIsAnErrorOfWriting) {
  const std::string run = folder_.file("a.h5");
  ASSERT_EQ(graupel("simulate " + scene_ + " --frames 1 -o " + run).exit_code, 0);
  for (const std::string& arguments :
       {std::string("--help"), std::string("--version"), std::string("convert --help"), "inspect " + scene_,
        "inspect " + run, "validate " + run, std::string("inspect models/hgn.safetensors"),
        "simulate --dry-run " + scene_, "validate " + scene_, "inspect --json - " + scene_,
        std::string("doctor --threads 1"), std::string("simulate --print-defaults"), std::string("completion bash"),
        std::string("man"), std::string("train nsf --help"),
        "compare --scenes " + scene_ + " --models mpm --no-floors --frames 1 --threads 1"}) {
    if (arguments.starts_with("train") && !training_is_built()) continue;
    const Outcome outcome = run_program("/bin/sh", "-c '" GRAUPEL_BINARY_DIR "/graupel " + arguments + " >&-'");
    EXPECT_EQ(outcome.exit_code, 5) << arguments << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("standard output")) << arguments << "\n" << outcome.output;
  }
  // What says nothing there does its work, and no file takes the number of a closed stream.
  const std::string closed = "-c '" GRAUPEL_BINARY_DIR "/graupel simulate " + scene_ + " --frames 1 -o " + run;
  EXPECT_EQ(run_program("/bin/sh", closed + " >&- 2>&- <&-'").exit_code, 0);
  EXPECT_EQ(io::TrajectoryReader(run).header(0).frame_count(), 2u);
}

TEST_F(Streams, JsonOnStandardOutputIsAlone) {
  const std::string run = folder_.file("a.h5"), cpu = " --device cpu --threads 1";
  EXPECT_EQ(json_of("simulate " + scene_ + " --frames 2 -o " + run + cpu)["frames"], 2);
  EXPECT_GT(json_of("simulate --dry-run " + scene_ + cpu)["particles"], 0);
  EXPECT_EQ(json_of("inspect " + scene_)["kind"], "scene");
  EXPECT_EQ(json_of("inspect scenes/recipes/hgn.json")["train"], 800);
  EXPECT_EQ(json_of("validate " + scene_)["files"].size(), 1u);
  EXPECT_EQ(json_of("doctor --threads 1")["kind"], "machine");
  EXPECT_EQ(
      json_of("rollout models/hgn.safetensors " + scene_ + " --frames 1 -o " + folder_.file("b.h5") + cpu)["frames"],
      1);
  EXPECT_EQ(json_of("export " + run + " -f ply -o " + folder_.file("ply"))["frames"], 3);
  EXPECT_EQ(json_of("convert " + scene_ + " " + folder_.file("all.json"))["kind"], "scene");
  EXPECT_TRUE(json_of("compare --scenes " + scene_ + " --models mpm --no-floors --frames 1" + cpu).contains("scenes"));
  EXPECT_EQ(json_of("generate scenes/recipes/hgn.json -o " + folder_.file("d") + cpu +
                    " --set counts.train=1 --set counts.valid=0 --set counts.test=0 --set frames=1")["complete"],
            true);
  EXPECT_EQ(json_of("inspect " + folder_.file("d"))["splits"]["train"]["trajectories"], 1);
}

TEST_F(Streams, TextOfFilesReachesTheTerminalAsText) {
  const std::string run = folder_.file("a.h5"), bad = "\x1b[31mred\x07";
  Trajectory header;
  header.particle_type = {5};
  header.made_by = bad;
  {
    io::TrajectoryWriter writer(run, header, {});
    ParticleFrame frame;
    frame.position = frame.velocity = {{0.5f, 0.5f, 0.5f}};
    writer.append(frame);
    writer.finish();
  }
  const std::string weights_header = "{\"__metadata__\":{\"\\u001b[31mred\":\"\\u001b]0;title\\u0007\"}}";
  std::string weights(8, '\0');
  weights[0] = static_cast<char>(weights_header.size());
  const std::string scene = folder_.write("named.json", [] {
    std::string text = small_scene();
    text.replace(text.find("\"small\""), 7, "\"\\u001b[31mred\"");
    return text;
  }());
  for (const std::string& arguments :
       {"inspect " + run, "inspect " + folder_.write("w.safetensors", weights + weights_header), "inspect " + scene,
        "simulate " + scene + " --frames 1 --threads 1 -o " + folder_.file("b.h5"),
        "compare --scenes " + scene + " --models mpm --no-floors --frames 1 --threads 1"}) {
    const Outcome outcome = graupel(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    for (const char c : {'\x1b', '\x07'}) EXPECT_EQ(outcome.output.find(c), std::string::npos) << arguments;
  }
}

/// A run whose disk is full is recovered on another one.
TEST_F(Streams, RecoveryToAnotherPlace) {
  const std::string run = folder_.file("a.h5"), there = folder_.file("there.h5");
  {
    Child child(folder_, "simulate " + scene_ + " --frames 20000 --threads 1 --device cpu -o " + run);
    for (int i = 0; i < 200 && !std::filesystem::exists(run + ".part"); ++i) child.ends_within(0.1);
    child.ends_within(3);
    child.send(SIGKILL);
    ASSERT_TRUE(child.ends_within(5));
  }
  const Outcome onto_itself = graupel("inspect --recover " + run + " -o " + run + ".part");
  EXPECT_EQ(onto_itself.exit_code, 2) << onto_itself.output;
  const Outcome outcome = graupel("inspect --recover " + run + " -o " + there);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_GT(io::TrajectoryReader(there).read(0, {}).frame_count(), 1u);
  EXPECT_FALSE(std::filesystem::exists(run));
  EXPECT_TRUE(std::filesystem::exists(run + ".part"));
  EXPECT_EQ(graupel("inspect " + there + " -o x.h5").exit_code, 2);
}

}  // namespace
}  // namespace graupel::test
