// Sweep recipes: the scenes of their runs, one bad recipe for each rule, and whose fault a bad run is.
#include "io/scene/sweep_reader.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_draw.h"
#include "replaced.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::string scene_text = R"({
  "name": "heap",
  "domain": { "dx": 0.04 },
  "materials": { "sand": { "preset": "dry_sand" } },
  "sources": [ { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.5, 0.4, 0.5], "material": "sand" } ],
  "frames": 7, "frame_time": 0.01
})";

const std::string recipe_text = R"({
  "name": "slopes",
  // Relative to this file.
  "scene": "scenes/heap.json",
  "set": { "frames": 3, "gravity": [0, -5, 0] },
  "parameters": [
    { "name": "angle", "unit": "degrees", "key": "materials.sand.friction_angle", "values": [20, 25.5, 30, 35],
      "also": [ { "key": "sources.0.velocity", "values": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 3, 0]] } ] },
    { "name": "stiffness", "unit": "Pa", "key": "materials.sand.youngs_modulus", "values": [1e5, 2e5, 3e5, 4e5] }
  ],
  "test": [3, 1], "valid": [2],
  "fields": "stress,affine", "deflate": 4
})";

class SweepReader : public ::testing::Test {
 protected:
  SweepReader() { folder_.write("scenes/heap.json", scene_text); }
  Sweep read(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    return read_sweep(folder_.write("sweep.json", text), overrides);
  }
  void fails(const std::string& from, const std::string& to, const std::vector<std::string>& parts) const {
    expect_error<ConfigError>([&] { read(replaced(recipe_text, from, to)); }, parts);
  }
  TemporaryFolder folder_;
};

TEST_F(SweepReader, RunsTakeTheirValueOfEveryList) {
  const Sweep sweep = read(recipe_text);
  ASSERT_EQ(sweep.run_count(), 4);
  const double angles[] = {20, 25.5, 30, 35};
  const Vec3d velocities[] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 3, 0}};
  for (std::size_t run = 0; run < 4; ++run) {
    const Scene& scene = sweep.scenes[run];
    EXPECT_EQ(scene.materials.at("sand").friction_angle, angles[run]);
    EXPECT_EQ(scene.materials.at("sand").youngs_modulus, 1e5 * static_cast<double>(run + 1));
    EXPECT_EQ(scene.materials.at("sand").density, 1600);
    EXPECT_EQ(scene.sources[0].velocity, velocities[run]);
    EXPECT_EQ(scene.frames, 3);
    EXPECT_EQ(scene.gravity, (Vec3d{0, -5, 0}));
    EXPECT_EQ(scene.domain.dx, 0.04);
  }
  EXPECT_EQ(sweep.recipe.test, (std::vector<int64_t>{1, 3}));
  EXPECT_EQ(sweep.recipe.valid, std::vector<int64_t>{2});
  EXPECT_EQ(sweep.recipe.fields_stored, "stress,affine");
  EXPECT_EQ(sweep.recipe.deflate, 4);
  EXPECT_EQ(sweep.run_text(1), "run 1 (angle = 25.5 degrees, stiffness = 2e+05 Pa)");
}

TEST_F(SweepReader, RoundTripsAndTakesTheScenesName) {
  const Sweep sweep = read(replaced(recipe_text, "\"name\": \"slopes\",", ""));
  EXPECT_EQ(sweep.recipe.name, "heap");
  const std::string text = sweep_to_json(sweep.recipe);
  const Sweep again = read(text);
  EXPECT_EQ(sweep_to_json(again.recipe), text);
  for (std::size_t run = 0; run < 4; ++run)
    EXPECT_EQ(scene_to_json(again.scenes[run]), scene_to_json(sweep.scenes[run]));
}

TEST_F(SweepReader, OverridesChangeTheRecipeAndItsScene) {
  const Sweep sweep = read(recipe_text, {"deflate=9", "parameters.1.values.0=7e4", "scene.frames=5",
                                         "scene.domain.dx=0.02", "scene.domain.walls=stick"});
  EXPECT_EQ(sweep.recipe.deflate, 9);
  EXPECT_EQ(sweep.scenes[0].materials.at("sand").youngs_modulus, 7e4);
  EXPECT_EQ(sweep.scenes[3].frames, 5);
  EXPECT_EQ(sweep.scenes[3].domain.dx, 0.02);
  EXPECT_EQ(sweep.scenes[3].domain.walls, Contact::stick);
  EXPECT_EQ(sweep.scenes[3].gravity, (Vec3d{0, -5, 0}));
  // A whole value replaces what the recipe set inside it.
  const std::string inner = replaced(recipe_text, "\"frames\": 3", "\"domain.dx\": 0.02");
  EXPECT_EQ(read(inner, {"scene.domain={\"dx\": 0.03}"}).scenes[0].domain.dx, 0.03);
  // Without `set` in the file.
  const std::string without = replaced(recipe_text, "\"set\": { \"frames\": 3, \"gravity\": [0, -5, 0] },", "");
  EXPECT_EQ(read(without, {"scene.frames=2"}).scenes[0].frames, 2);
}

TEST_F(SweepReader, ASetForTestingHasNoTrainingRun) {
  const std::string all = replaced(recipe_text, "\"test\": [3, 1]", "\"test\": [0, 3, 1]");
  EXPECT_EQ(read(replaced(all, "\"deflate\": 4", "\"training\": \"none\"")).recipe.training, TrainingRuns::none);
}

const std::string drawn_text = R"({
  "scene": "scenes/heap.json",
  "draw": { "train": 9, "valid": 2, "test": 8, "seed": 3 },
  "parameters": [
    { "name": "angle", "unit": "degrees", "key": "materials.sand.friction_angle", "range": [20, 36],
      "also": [ { "key": "sources.0.velocity", "range": [[0, 1, -2], [2, 1, 2]] },
                { "key": "materials.sand.density", "range": [1000, 2000] } ] },
    { "name": "stiffness", "unit": "Pa", "key": "materials.sand.youngs_modulus", "range": [1e5, 3e5] }
  ]
})";

TEST_F(SweepReader, HaltonsPointsAreRadicalInverses) {
  const double base_two[] = {0.5, 0.25, 0.75, 0.125, 0.625}, base_three[] = {1, 2, 1. / 3, 4. / 3, 7. / 3};
  for (int64_t i = 0; i < 5; ++i) {
    EXPECT_DOUBLE_EQ(halton(i + 1, 0), base_two[i]);
    EXPECT_DOUBLE_EQ(halton(i + 1, 1), base_three[i] / 3);
  }
}

TEST_F(SweepReader, DrawsRunsInTheBoxOfTheRanges) {
  const Sweep sweep = read(drawn_text);
  ASSERT_EQ(sweep.run_count(), 19);
  EXPECT_EQ(sweep.recipe.valid, (std::vector<int64_t>{9, 10}));
  EXPECT_EQ(sweep.recipe.test, (std::vector<int64_t>{11, 12, 13, 14, 15, 16, 17, 18}));
  const auto& angle = sweep.recipe.parameters[0].values;
  const auto& stiffness = sweep.recipe.parameters[1].values;
  // Corners, then Halton's points in bases two and three.
  const double angles[] = {20, 36, 20, 36, 28, 24, 32, 22, 30},
               parts[] = {0, 0, 1, 1, 1. / 3, 2. / 3, 1. / 9, 4. / 9, 7. / 9};
  for (std::size_t run = 0; run < 9; ++run) {
    EXPECT_DOUBLE_EQ(angle[run], angles[run]);
    EXPECT_DOUBLE_EQ(stiffness[run], 1e5 + 2e5 * parts[run]);
  }
  for (std::size_t run = 9; run < 19; ++run) {
    EXPECT_GT(angle[run], 20);
    EXPECT_LT(angle[run], 36);
    EXPECT_NE(angle[run], angle[run - 1]);
    EXPECT_NE((angle[run] - 20) / 16, (stiffness[run] - 1e5) / 2e5);
  }
  for (std::size_t run = 0; run < 19; ++run) {  // followers are linear in their parameter
    const double t = (angle[run] - 20) / 16;
    const Scene& scene = sweep.scenes[run];
    EXPECT_EQ(scene.materials.at("sand").friction_angle, angle[run]);
    EXPECT_NEAR(norm(scene.sources[0].velocity - Vec3d{2 * t, 1, 4 * t - 2}), 0, 1e-14);
    EXPECT_NEAR(scene.materials.at("sand").density, 1000 * (1 + t), 1e-9);
  }
}

TEST_F(SweepReader, DrawnRunsDependOnTheSeedAndNotOnTheOtherSplits) {
  const auto angles = [&](const std::vector<std::string>& overrides) {
    return read(drawn_text, overrides).recipe.parameters[0].values;
  };
  const auto runs = angles({}), other = angles({"draw.seed=4"}), more = angles({"draw.train=16", "draw.valid=0"});
  EXPECT_TRUE(std::equal(runs.begin(), runs.begin() + 9, other.begin()));
  for (std::size_t run = 9; run < 19; ++run) EXPECT_NE(runs[run], other[run]);
  EXPECT_TRUE(std::equal(runs.end() - 8, runs.end(), more.end() - 8));
}

TEST_F(SweepReader, DrawnRecipesRoundTripAsLists) {
  const Sweep sweep = read(drawn_text);
  const std::string text = sweep_to_json(sweep.recipe);
  const Sweep again = read(text);
  EXPECT_EQ(sweep_to_json(again.recipe), text);
  for (std::size_t run = 0; run < 19; ++run)
    EXPECT_EQ(scene_to_json(again.scenes[run]), scene_to_json(sweep.scenes[run]));
}

TEST_F(SweepReader, RefusesBadDrawsOneRuleEach) {
  const auto bad = [&](const std::string& from, const std::string& to, const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { read(replaced(drawn_text, from, to)); }, parts);
  };
  bad("\"train\": 9", "\"train\": 3",
      {"sweep.json:3: /draw/train is less than the corners of the box (3, allowed 0, or at least 4 with 2 "
       "parameters)"});
  bad("\"range\": [20, 36]", "\"values\": [20, 36]", {"/parameters/0/values has no effect beside 'draw'"});
  bad("\"range\": [20, 36]", "\"range\": [20, 20]", {"sweep.json:5: /parameters/0/range is missing or empty"});
  bad("\"range\": [20, 36]", "\"range\": [36, 20]", {"/parameters/0/range"});
  bad("\"range\": [1000, 2000]", "\"range\": [1000]", {"/parameters/0/also/1/range needs two values, and has 1"});
  bad("\"range\": [1000, 2000]", "\"range\": [1000, [1]]",
      {"/parameters/0/also/1/range is not two numbers or two vectors"});
  bad("\"range\": [1000, 2000]", "\"values\": [1000, 2000]",
      {"/parameters/0/also/1/values has no effect beside 'draw'"});
  bad("\"parameters\"", "\"test\": [1], \"parameters\"", {"/test names runs, and 'draw' draws them"});
  bad("\"draw\": { \"train\": 9, \"valid\": 2, \"test\": 8, \"seed\": 3 },", "",
      {"/parameters/0/range has no effect without 'draw'"});
  fails(", \"values\": [1e5, 2e5, 3e5, 4e5]", "", {"sweep.json:9: /parameters/1 has 0 values, and 'angle' 4"});
}

TEST_F(SweepReader, TellsSweepsFromRandomRecipes) {
  EXPECT_TRUE(is_sweep(folder_.write("sweep.json", recipe_text)));
  EXPECT_FALSE(is_sweep(GRAUPEL_SOURCE_DIR "/scenes/recipes/hgn.json"));
}

TEST_F(SweepReader, ShippedRecipesAreGood) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(GRAUPEL_SOURCE_DIR "/scenes/recipes")) {
    if (entry.path().extension() != ".json") continue;
    const std::string path = entry.path().string();
    EXPECT_NO_THROW(is_sweep(path)             ? (void)read_sweep(path)
                    : is_category_recipe(path) ? (void)read_category_recipe(path)
                                               : (void)read_recipe(path))
        << path;
    ++count;
  }
  EXPECT_GT(count, 0);
}

TEST_F(SweepReader, RefusesBadRecipesOneRuleEach) {
  fails("\"scene\": \"scenes/heap.json\",", "", {"sweep.json:1: the top level lacks the key 'scene'"});
  fails("\"deflate\": 4", "\"deflat\": 4", {"/deflat is not a known key", "Did you mean 'deflate'?"});
  fails("\"deflate\": 4", "\"deflate\": 10", {"sweep.json:12: /deflate is out of range (10, allowed >= 0 and <= 9)"});
  fails("\"stress,affine\"", "\"stres\"", {"sweep.json:12: /fields", "no field 'stres'", "Did you mean 'stress'?"});
  fails("[1e5, 2e5, 3e5, 4e5]", "[1e5, 2e5, 3e5]",
        {"sweep.json:9: /parameters/1/values has 3 values, and 'angle' 4", "as many values as there are runs"});
  fails("[2, 0, 0], [0, 3, 0]]", "[2, 0, 0]]", {"sweep.json:8: /parameters/0/also/0/values has 3 values"});
  fails("[20, 25.5, 30, 35]", "[]", {"sweep.json:7: /parameters/0/values has no value"});
  fails("[20, 25.5, 30, 35]", "[20, \"x\", 30, 35]", {"/parameters/0/values/1 must be a number (\"x\")"});
  fails("\"name\": \"angle\"", "\"name\": \"\"", {"/parameters/0/name is empty"});
  fails("\"name\": \"stiffness\"", "\"name\": \"angle\"", {"sweep.json:9: /parameters/1/name is given twice (angle)"});
  fails("materials.sand.youngs_modulus", "sources.0.velocity",
        {"/parameters/1/key is given twice (sources.0.velocity)"});
  fails("\"frames\": 3", "\"materials.sand.youngs_modulus\": 3",
        {"sweep.json:5: /set/materials.sand.youngs_modulus has no effect: a parameter sets this key"});
  fails("\"test\": [3, 1]", "\"test\": [3, 4]", {"sweep.json:11: /test/1 is not a run (4, allowed 0 to 3)"});
  fails("\"test\": [3, 1]", "\"test\": [3, -1]", {"/test/1 is out of range (-1, allowed >= 0)"});
  fails("\"test\": [3, 1]", "\"test\": [3, 1, 3]", {"/test/2 names a run twice (3)"});
  fails("\"valid\": [2]", "\"valid\": [1]", {"/valid/0 names a run twice (1)"});
  fails("\"test\": [3, 1]", "\"test\": [0, 1, 3]", {"leave no run for training (4 of 4 used)"});
  fails("\"deflate\": 4", "\"training\": \"none\"", {"/training is none, and 1 runs are in neither"});
  expect_error<ConfigError>([&] { read("{\"scene\": \"scenes/heap.json\", \"parameters\": []}"); },
                            {"/parameters names no parameter"});
}

TEST_F(SweepReader, RefusesASceneFileThatIsMissing) {
  expect_error<InputError>([&] { read(replaced(recipe_text, "heap.json", "heep.json")); },
                           {"sweep.json:4: /scene names a file that is not there", "scenes/heep.json", "relative"});
  expect_error<InputError>([&] { read_sweep(folder_.file("absent.json")); }, {"absent.json"});
}

TEST_F(SweepReader, NamesTheParameterThatMakesASceneBad) {
  fails("friction_angle", "friction_angel",
        {"sweep.json:7: /parameters/0 ('angle')", "run 0 (angle = 20 degrees, stiffness = 1e+05 Pa)",
         "heap.json (override materials.sand.friction_angel=20): /materials/sand/friction_angel is not a known key",
         "Did you mean 'friction_angle'?"});
  fails("sand.youngs_modulus", "sandd.youngs_modulus",
        {"/parameters/1 ('stiffness')", "/materials/sandd does not exist", "Did you mean 'sand'?"});
  fails("[20, 25.5, 30, 35]", "[20, 25.5, 95, 35]",
        {"/parameters/0 ('angle')", "run 2 (angle = 95", "is out of range (95, allowed >= 0 and < 90)"});
  fails("sources.0.velocity", "sources.1.velocity", {"/parameters/0 ('angle')", "no list item '1'"});
  fails("[1, 0, 0], ", "[1, 0], ", {"/parameters/0 ('angle')", "run 1", "must be a list of 3 numbers ([1,0])"});
}

TEST_F(SweepReader, NamesABadSet) {
  fails("\"gravity\"", "\"gravty\"", {"sweep.json:5: /set: ", "/gravty is not a known key", "Did you mean 'gravity'?"});
  expect_error<ConfigError>([&] { read(recipe_text, {"scene.domain.dx=-1"}); },
                            {"/set", "(override domain.dx=-1): /domain/dx is out of range"});
  expect_error<ConfigError>([&] { read(recipe_text, {"set.domain.dx=0.1"}); },
                            {"sweep.json (override set.domain.dx=0.1)", "Write scene.domain.dx=0.1"});
}

TEST_F(SweepReader, RunsShareFramesAndSeed) {
  fails("materials.sand.youngs_modulus", "frame_time", {"changes the scene's 'frame_time' in run 1"});
  fails("materials.sand.youngs_modulus", "seed", {"changes the scene's 'seed' in run 1"});
  fails(
      "\"key\": \"materials.sand.youngs_modulus\", \"values\": [1e5, 2e5, 3e5, 4e5]",
      "\"key\": \"obstacle_voxel\", \"values\": [1, 1, 1, 1], \"also\": [{\"key\": \"frame_time\", \"values\": [1, 1, "
      "1, 2]}]",
      {"changes the scene's 'frame_time' in run 3"});
}

}  // namespace
}  // namespace graupel::io
