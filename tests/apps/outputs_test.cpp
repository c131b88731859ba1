// No output takes the place of what a run reads, of another output, or of a device.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/apps/child.h"

namespace graupel::test {
namespace {

/// A tetrahedron.
const char* const mesh = "v 0 0 0\nv 0.2 0 0\nv 0 0.2 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

class Outputs : public ::testing::Test {
 protected:
  void expect_refused(const std::string& arguments) const {
    const Outcome outcome = graupel(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("would overwrite") || outcome.says("same file")) << arguments << "\n" << outcome.output;
    EXPECT_EQ(text_of(scene_), scene_text_) << arguments;
    EXPECT_EQ(text_of(weights_), model_) << arguments;
    EXPECT_EQ(text_of(mesh_), mesh) << arguments;
  }
  std::string make_run(const std::string& name) const {
    const std::string run = folder_.file(name);
    EXPECT_EQ(graupel("simulate " + scene_ + " --frames 1 -o " + run).exit_code, 0);
    return run;
  }

  Folder folder_;
  std::string mesh_ = folder_.write("bowl.obj", mesh);
  std::string scene_text_ =
      small_scene("  \"obstacles\": [{ \"shape\": \"mesh\", \"file\": \"bowl.obj\", \"position\": [0.2, 0.2, 0.2] }]");
  std::string scene_ = folder_.write("scene.json", scene_text_);
  std::string model_ = text_of(GRAUPEL_SOURCE_DIR "/models/hgn.safetensors");
  std::string weights_ = folder_.write("w.safetensors", model_);
};

TEST_F(Outputs, OfSimulate) {
  const std::string simulate = "simulate " + scene_ + " --frames 1 -o ", run = folder_.file("run.h5");
  std::filesystem::create_symlink(scene_, folder_.file("link.json"));
  std::filesystem::create_hard_link(scene_, folder_.file("hard.json"));
  for (const char* name : {"scene.json", "./scene.json", "link.json", "hard.json", "bowl.obj"}) {
    expect_refused(simulate + folder_.file(name));
    expect_refused(simulate + run + " --json " + folder_.file(name));
    expect_refused(simulate + run + " --save-state " + folder_.file(name));
    expect_refused(simulate + run + " --write-obstacles " + folder_.file(name));
    expect_refused("simulate " + scene_ + " --dry-run --json " + folder_.file(name));
  }
  expect_refused(simulate + run + " --json " + run);
  expect_refused(simulate + run + " --json " + run + ".part");
  expect_refused(simulate + run + " --save-state " + folder_.file("a") + " --json " + folder_.file("./a"));
}

TEST_F(Outputs, AnEmptyNameIsNoDefault) {
  const std::string weights = "models/hgn.safetensors ", cpu = " --frames 1 --device cpu";
  for (const std::string& arguments :
       {"simulate " + scene_ + cpu + " -o \"\"", "simulate " + scene_ + cpu + " --save-state \"\"",
        "simulate " + scene_ + cpu + " --json \"\"", "simulate " + scene_ + cpu + " --write-obstacles \"\"",
        "rollout " + weights + scene_ + cpu + " -o \"\"", "export " + scene_ + " -o \"\"",
        "compare --scenes " + scene_ + " --models mpm --report \"\"",
        "compare --scenes " + scene_ + " --models mpm --csv \"\"", std::string("demo -o \"\""),
        std::string("completion bash -o \"\""), std::string("generate scenes/recipes/hgn.json -o \"\""),
        "convert " + scene_ + " \"\"", "inspect " + scene_ + " --json \"\""}) {
    const Outcome outcome = graupel(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("is empty")) << arguments << "\n" << outcome.output;
  }
}

/// A state may be replaced by a later one, and by nothing else.
TEST_F(Outputs, OfARunThatGoesOn) {
  const std::string state = folder_.file("a.state"), run = folder_.file("run.h5");
  ASSERT_EQ(graupel("simulate " + scene_ + " --frames 1 -o " + run + " --save-state " + state).exit_code, 0);
  const std::string bytes = text_of(state);
  expect_refused("simulate --resume " + state + " --frames 2 -o " + state);
  expect_refused("simulate --resume " + state + " --frames 2 --json " + state);
  // Nor is the state written over a file of another kind: here the scene, whose path a resumed run does not know.
  expect_refused("simulate --resume " + state + " --frames 2 --save-state " + scene_);
  EXPECT_EQ(text_of(state), bytes);
  EXPECT_EQ(graupel("simulate --resume " + state + " --frames 2 --save-state " + state).exit_code, 0);
}

TEST_F(Outputs, OfRolloutAndCompare) {
  const std::string rollout = "rollout " + weights_ + " " + scene_ + " --frames 1 -o ", run = make_run("run.h5");
  for (const std::string& input : {scene_, weights_, mesh_}) {
    expect_refused(rollout + input);
    expect_refused(rollout + folder_.file("b.h5") + " --json " + input);
    for (const char* flag : {" --json ", " --csv ", " --report ", " --write-floors "})
      expect_refused("compare --scenes " + scene_ + " --models mpm," + weights_ +
                     (flag == std::string(" --write-floors ") ? "" : " --no-floors") + " --frames 1" + flag + input);
  }
  const std::string bytes = text_of(run);
  expect_refused("rollout " + weights_ + " " + run + " --start truth:6 -o " + run);
  expect_refused("rollout " + weights_ + " " + run + " -o " + mesh_);  // that of the scene in it
  EXPECT_EQ(text_of(run), bytes);
}

TEST_F(Outputs, OfTheOtherVerbs) {
  const std::string run = make_run("run.h5"), bytes = text_of(run);
  for (const std::string& input : {run, mesh_}) {
    expect_refused("inspect " + run + " --json " + input);
    expect_refused("validate " + run + " --json " + input);
    expect_refused("export " + run + " -o " + folder_.file("e") + " --json " + input);
    expect_refused("view " + run + " --json " + input);
  }
  expect_refused("export " + run + " --surface -f obj --name bowl -o " + folder_.file("."));
  expect_refused("convert " + weights_ + " " + weights_ + " --numbers f16");
  expect_refused("convert " + scene_ + " " + scene_);
  expect_refused("convert " + scene_ + " " + mesh_);
  EXPECT_EQ(text_of(run), bytes);
  const std::string recipe = folder_.write("recipe.json",
                                           "{ \"scene\": \"scene.json\", \"parameters\": [{ \"name\": \"g\", \"key\": "
                                           "\"gravity.1\", \"values\": [-9, -10] }], \"test\": [1] }");
  const std::string recipe_text = text_of(recipe);
  for (const std::string& input : {recipe, scene_, mesh_})
    expect_refused("generate " + recipe + " -o " + folder_.file("d") + " --json " + input);
  EXPECT_EQ(text_of(recipe), recipe_text);
  expect_refused("generate " + recipe + " -o " + folder_.file("d") + " --json " + folder_.file("d"));
}

TEST_F(Outputs, OfBench) {
  const std::string recipe = folder_.write("recipe.json", text_of(GRAUPEL_SOURCE_DIR "/scenes/recipes/hgn.json"));
  const std::string recipe_text = text_of(recipe);
  for (const std::string& input : {recipe, weights_}) {
    expect_refused("bench graph --models " + weights_ + " --recipe " + recipe + " --json " + input);
    EXPECT_EQ(text_of(recipe), recipe_text);
  }
  expect_refused("bench mpm --recipe " + recipe + " --json " + recipe);
  EXPECT_EQ(text_of(recipe), recipe_text);
  for (const std::string& input : {scene_, weights_, mesh_})
    expect_refused("bench micro --scene " + scene_ + " --weights " + weights_ + " --json " + input);
  for (const std::string& input : {weights_, mesh_})
    expect_refused("bench rom " + weights_ + " " + folder_.file(".") + " --json " + input);
}

TEST_F(Outputs, OfTraining) {
  const std::string data = folder_.file("data"), run = folder_.file("run");
  std::filesystem::create_directory(data);
  std::filesystem::rename(make_run("run.h5"), data + "/train.h5");
  const std::string bytes = text_of(data + "/train.h5");
  const std::string settings = folder_.write("settings.json", "{}");
  const std::string words = " --data " + data + " --json ", train = "train ";
  for (const std::string& input : {data + "/train.h5", mesh_, weights_, settings}) {
    for (const char* network : {"hgn", "gns"})
      expect_refused(train + network + " --config " + settings + " --from " + weights_ + " --out " + run + words +
                     input);
    if (input == weights_) continue;
    for (const char* model : {"nsf", "crom"})
      expect_refused(train + model + " --config " + settings + " --out " + run + words + input);
  }
  EXPECT_EQ(graupel(train + "hgn --data " + data + " --out " + mesh_).exit_code, 5);
  const Outcome inside = graupel(train + "hgn --data " + data + " --out " + data);
  EXPECT_EQ(inside.exit_code, 2) << inside.output;
  EXPECT_TRUE(inside.says("would be written into the data")) << inside.output;
  expect_refused("train hgn --evaluate " + weights_ + " --split train" + words + weights_);
  expect_refused("train hgn --evaluate " + weights_ + " --split train" + words + data + "/train.h5");
  expect_refused("train time " + weights_ + " --data " + data + "/train.h5 --json " + weights_);
  expect_refused("train coarse --recipe " GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json --from " + weights_ +
                 " --out " + run + " --json " + weights_);
  EXPECT_EQ(text_of(data + "/train.h5"), bytes);
  EXPECT_EQ(text_of(settings), "{}");
  EXPECT_FALSE(std::filesystem::exists(run));
}

/// New weights would take the place of those that training starts from.
TEST_F(Outputs, OfARunFolder) {
  const std::string run = folder_.file("run"), old = run + "/weights.safetensors";
  std::filesystem::create_directory(run);
  std::filesystem::create_hard_link(weights_, old);
  expect_refused("train coarse --recipe " GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json --from " + old + " --out " +
                 run);
  expect_refused("train hgn --data " + run + " --from " + old + " --out " + run);
  EXPECT_EQ(text_of(old), model_);
}

/// A pipe stands for a device, which only root can make.
TEST_F(Outputs, ReplaceNoDevice) {
  const std::string pipe = folder_.file("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& arguments :
       {"simulate " + scene_ + " --frames 1 -o " + pipe,
        "simulate " + scene_ + " --frames 1 -o " + folder_.file("a.h5") + " --write-obstacles " + pipe,
        "simulate " + scene_ + " --frames 1 -o " + folder_.file("a.h5") + " --save-state " + pipe,
        "rollout " + weights_ + " " + scene_ + " --frames 1 -o " + pipe}) {
    const Outcome outcome = graupel(arguments);
    EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
    EXPECT_TRUE(outcome.says("no regular file")) << outcome.output;
    EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.file("a.h5")));
}

/// The scene is a stranger's.
TEST_F(Outputs, OfASceneWithoutANameForThemStayHere) {
  const std::string scene = folder_.write("far.json", small_scene("  \"frame_time\": 0.001"));
  const std::string text = text_of(scene), name = "\"name\": \"small\"";
  std::string far = text;
  far.replace(far.find(name), name.size(), "\"name\": \"../far\"");
  folder_.write("far.json", far);
  std::filesystem::create_directory(folder_.file("in"));
  const Outcome outcome =
      run_program("/bin/sh", "-c 'cd " + folder_.file("in") +
                                 " && " GRAUPEL_BINARY_DIR "/graupel simulate ../far.json --frames 0'");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("far.h5")));
  EXPECT_TRUE(std::filesystem::exists(folder_.file("in/.._far.h5")));
}

}  // namespace
}  // namespace graupel::test
