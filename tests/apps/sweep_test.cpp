// Sweeps: data sets of one scene's parameters, with the same particles in every run.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"
#include "tests/gpu_only.h"

namespace graupel::test {
namespace {

const std::string heap = R"({
  "name": "heap",
  "domain": { "dx": 0.04 },
  "materials": { "sand": { "preset": "dry_sand", "youngs_modulus": 1e5 } },
  "sources": [ { "shape": "box", "size": [0.2, 0.16, 0.2], "position": [0.5, 0.3, 0.5], "material": "sand" } ],
  "time_step": { "policy": "fixed", "substeps_per_frame": 20 },
  "seed": 11, "frames": 9, "frame_time": 0.01
})";

const std::string sweep = R"({
  "name": "slopes", "scene": "heap.json", "set": { "frames": 3 },
  "parameters": [
    { "name": "angle", "unit": "degrees", "key": "materials.sand.friction_angle", "values": [20, 25, 30, 35, 40],
      "also": [ { "key": "sources.0.velocity", "values": [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, -1, 0], [0, 0, 0]] } ] },
    { "name": "friction", "key": "domain.wall_friction", "values": [0.1, 0.2, 0.3, 0.4, 0.5] }
  ],
  "test": [3], "valid": [1], "fields": "stress,affine", "deflate": 6
})";

class SweepSet : public ::testing::Test {
 protected:
  SweepSet() {
    folder_.write("heap.json", heap);
    recipe_ = folder_.write("sweep.json", sweep);
  }
  Outcome generate(const std::string& flags, const std::string& set) const {
    return graupel("generate " + recipe_ + " --device cpu " + flags + " -o " + folder_.file(set));
  }
  void expect_same(const std::string& a, const std::string& b) const {
    for (const char* name : {"/train.h5", "/valid.h5", "/test.h5", "/metadata.json"})
      EXPECT_TRUE(read_file(folder_.file(a + name)) == read_file(folder_.file(b + name))) << b << name << " differs";
    EXPECT_EQ(names_in(folder_.file(a)), names_in(folder_.file(b)));
  }
  Folder folder_;
  std::string recipe_;
};

TEST_F(SweepSet, KeepsTheMaterialsOfTwoSands) {
  std::string two = heap;
  two.replace(two.find("\"materials\": {") + 14, 0, " \"wet\": { \"preset\": \"dry_sand\", \"friction_angle\": 50 },");
  folder_.write("heap.json", two);
  const Outcome outcome = generate("", "set");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  for (const std::string split : {"train", "valid", "test"}) {
    const Trajectory t = io::TrajectoryReader(folder_.file("set/" + split + ".h5")).header(0);
    EXPECT_EQ(t.materials.names, (std::vector<std::string>{"sand", "wet"})) << split;
    EXPECT_EQ(t.materials.index, std::vector<int32_t>(t.particle_count(), 0)) << split;
  }
}

TEST_F(SweepSet, RunsShareParticlesAndKeepTheirParameters) {
  const Outcome outcome = generate("", "set");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const io::TrajectoryReader train(folder_.file("set/train.h5")), valid(folder_.file("set/valid.h5")),
      test(folder_.file("set/test.h5"));
  ASSERT_EQ(train.count(), 3);
  ASSERT_EQ(valid.count(), 1);
  ASSERT_EQ(test.count(), 1);
  const std::vector<Vec3f> reference = train.frames(0, 0, 1).front().position;
  const auto expect_run = [&](const io::TrajectoryReader& reader, int i, int run) {
    const Trajectory t = reader.read(i, {ParticleField::stress, ParticleField::affine});
    EXPECT_TRUE(t.frames[0].position == reference) << "run " << run;
    ASSERT_EQ(t.frame_count(), 4u);
    EXPECT_EQ(t.seed, 11u);
    EXPECT_EQ(reader.fields(i).names(), "stress,affine");
    for (const ParticleFrame& frame : t.frames) {
      EXPECT_EQ(frame.fields[ParticleField::stress].size(), 6 * t.particle_count());
      EXPECT_EQ(frame.fields[ParticleField::affine].size(), 9 * t.particle_count());
    }
    const std::vector<io::NamedValue> expected = {
        {"angle", "degrees", 20.0 + 5 * run, {"materials.sand.friction_angle", "sources.0.velocity"}},
        {"friction", "", std::vector{0.1, 0.2, 0.3, 0.4, 0.5}[run], {"domain.wall_friction"}}};
    EXPECT_EQ(reader.parameters(i), expected);
    const Scene scene = io::parse_scene(t.scene_json, "stored", ".");
    EXPECT_EQ(scene.materials.at("sand").friction_angle, 20.0 + 5 * run);
    EXPECT_EQ(scene.name, "slopes-0000" + std::to_string(run));
    const std::vector<Vec3f> velocity = reader.initial_velocity(i);
    ASSERT_EQ(velocity.size(), t.particle_count());
    for (const Vec3f& v : velocity) ASSERT_EQ(v, scene.sources[0].velocity.cast<float>());
  };
  expect_run(train, 0, 0);
  expect_run(valid, 0, 1);
  expect_run(train, 1, 2);
  expect_run(test, 0, 3);
  expect_run(train, 2, 4);
  // Other values move the particles elsewhere.
  EXPECT_FALSE(train.frames(0, 3, 1).front().position == train.frames(1, 3, 1).front().position);
  const auto card = nlohmann::json::parse(read_file(folder_.file("set/dataset.json")));
  EXPECT_EQ(card["recipe"]["parameters"][0]["name"], "angle");
  EXPECT_EQ(card["scene"]["frames"], 9);
  EXPECT_EQ(card["seed"], 11);
  const Outcome inspected = graupel("inspect " + folder_.file("set/test.h5"));
  EXPECT_TRUE(inspected.says("angle") && inspected.says("value: 35.0") && inspected.says("unit: degrees"))
      << inspected.output;
}

TEST_F(SweepSet, RunsEqualTheirSingleRun) {
  ASSERT_EQ(generate("--batch 3", "set").exit_code, 0);
  const io::TrajectoryReader set(folder_.file("set/train.h5"));
  const FieldSet fields = {ParticleField::stress, ParticleField::affine};
  const Trajectory made = set.read(1, fields);
  const Outcome alone = graupel("simulate " + folder_.write("run.json", made.scene_json) +
                                " --device cpu --no-velocity --fields stress,affine -o " + folder_.file("run.h5"));
  ASSERT_EQ(alone.exit_code, 0) << alone.output;
  const Trajectory single = io::TrajectoryReader(folder_.file("run.h5")).read(0, fields);
  ASSERT_EQ(made.frame_count(), single.frame_count());
  for (std::size_t f = 0; f < made.frame_count(); ++f) {
    EXPECT_TRUE(made.frames[f].position == single.frames[f].position) << f;
    for (const ParticleField field : {ParticleField::stress, ParticleField::affine})
      EXPECT_TRUE(made.frames[f].fields[field] == single.frames[f].fields[field]) << f;
  }
}

TEST_F(SweepSet, ResumesAndShardsToTheSameBytes) {
  ASSERT_EQ(generate("--threads 2", "whole").exit_code, 0);
  for (const char* shard : {"1/3", "2/3"}) ASSERT_EQ(generate(std::string("--shard ") + shard, "shards").exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_.file("shards/train.h5")));
  folder_.write("shards/parts/train-00001.h5", "not HDF5");  // what a kill leaves
  const Outcome rest = generate("--batch 4", "shards");
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  EXPECT_TRUE(rest.says("scenes are there already")) << rest.output;
  expect_same("whole", "shards");

  const auto stamp = std::filesystem::last_write_time(folder_.file("whole/train.h5"));
  ASSERT_EQ(generate("", "whole").exit_code, 0);
  EXPECT_EQ(std::filesystem::last_write_time(folder_.file("whole/train.h5")), stamp);
  // Whatever changes the scenes is another data set.
  for (const char* other : {"--seed 12", "--set deflate=0", "--set scene.frames=2", "--fields stress"})
    EXPECT_EQ(generate(other, "whole").exit_code, 2) << other;
  folder_.write("heap.json", std::string(heap).replace(heap.find("20 }"), 4, "21 }"));
  const Outcome changed = generate("", "whole");
  EXPECT_EQ(changed.exit_code, 2);
  EXPECT_TRUE(changed.says("another recipe or seed")) << changed.output;
}

TEST_F(SweepSet, FlagsChangeSeedFieldsAndScene) {
  const Outcome outcome = generate("--seed 12 --fields plastic --set scene.frames=1 --set deflate=0", "set");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const io::TrajectoryReader train(folder_.file("set/train.h5"));
  std::vector<Vec3f> first;
  for (int i = 0; i < train.count(); ++i) {
    const Trajectory t = train.read(i);
    EXPECT_EQ(t.seed, 12u);
    EXPECT_EQ(t.frame_count(), 2u);
    EXPECT_EQ(train.fields(i).names(), "plastic");
    if (i == 0) first = t.frames[0].position;
    EXPECT_TRUE(t.frames[0].position == first);
  }
  ASSERT_EQ(generate("--set scene.frames=1", "scenes_seed").exit_code, 0);
  EXPECT_FALSE(io::TrajectoryReader(folder_.file("scenes_seed/train.h5")).frames(0, 0, 1)[0].position == first);
}

TEST_F(SweepSet, ASetForTestingHasNoTrainingFile) {
  const Outcome outcome =
      generate("--set scene.frames=1 --set test=[0,1,2,3,4] --set valid=[] --set training=none", "set");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_EQ(io::TrajectoryReader(folder_.file("set/test.h5")).count(), 5);
  EXPECT_EQ(names_in(folder_.file("set")), (std::vector<std::string>{"dataset.json", "test.h5"}));
}

TEST_F(SweepSet, ADivergedRunIsAnErrorAfterTheOthers) {
  const std::string set = folder_.file("set");
  // Far more than a cell in a substep.
  const Outcome outcome = generate("--threads 1 --set parameters.0.also.0.values.2=[0,-500,0]", "set");
  EXPECT_EQ(outcome.exit_code, 4) << outcome.output;
  EXPECT_TRUE(outcome.says("1 of 5 scenes diverged, so no data set was made")) << outcome.output;
  EXPECT_TRUE(outcome.says("run 2 (angle = 30 degrees, friction = 0.3): ")) << outcome.output;
  EXPECT_EQ(names_in(set + "/parts"),
            (std::vector<std::string>{"test-00000.h5", "train-00000.h5", "train-00002.h5", "valid-00000.h5"}));
  for (const char* name : {"/train.h5", "/test.h5", "/redrawn.jsonl"})
    EXPECT_FALSE(std::filesystem::exists(set + name)) << name;
}

TEST_F(SweepSet, RunsWithOtherParticlesAreRefused) {
  const Outcome moved = generate(
      "--set parameters.1.key=domain.dx "
      "--set parameters.1.values=[0.04,0.04,0.03,0.04,0.04]",
      "set");
  EXPECT_EQ(moved.exit_code, 2);
  EXPECT_TRUE(moved.says("run 2 (angle = 30 degrees, friction = 0.03) starts with other particles than run 0"))
      << moved.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("set")));
  nlohmann::json recipe = nlohmann::json::parse(std::ifstream(recipe_));
  recipe["parameters"][1]["key"] = "domain.dx";
  recipe["parameters"][1]["values"] = {0.04, 0.04, 0.03, 0.04, 0.04};
  std::ofstream(recipe_) << recipe;
  const Outcome checked = graupel("validate " + recipe_);
  EXPECT_EQ(checked.exit_code, 3);
  EXPECT_TRUE(checked.says("starts with other particles than run 0")) << checked.output;
}

TEST_F(SweepSet, ParticlesThatLeaveAreMarked) {
  const Outcome outcome = generate(
      "--set 'scene.sinks=[{\"shape\": \"half_space\", \"normal\": [0, 1, 0], \"position\": [0, 0.27, 0]}]'", "set");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const ParticleFrame last = io::TrajectoryReader(folder_.file("set/test.h5")).frames(0, 3, 1).front();
  ASSERT_FALSE(last.active.empty());
  EXPECT_NE(std::count(last.active.begin(), last.active.end(), 0), 0);
}

TEST_F(SweepSet, BadRecipesAreUsageErrors) {
  const Outcome key = generate("--set parameters.1.key=domain.wall_frction", "set");
  EXPECT_EQ(key.exit_code, 2);
  EXPECT_TRUE(key.says("('friction')") && key.says("Did you mean 'wall_friction'?")) << key.output;
  const Outcome missing = generate("--set scene=absent.json", "set");
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_TRUE(missing.says("absent.json")) << missing.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("set")));
}

TEST_F(SweepSet, InspectShowsARecipe) {
  const Outcome outcome = graupel("inspect " + recipe_);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  for (const char* part : {"kind: sweep", "runs: 5", "key: materials.sand.friction_angle", "unit: degrees"})
    EXPECT_TRUE(outcome.says(part)) << part << "\n" << outcome.output;
}

TEST_F(SweepSet, HelpIsShort) {
  const Outcome help = graupel("generate --help");
  EXPECT_LT(std::count(help.output.begin(), help.output.end(), '\n'), 40);
  EXPECT_TRUE(help.says("scene.domain.dx=0.02")) << help.output;
}

TEST_F(SweepSet, BytesDoNotDependOnTheBatchOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  for (const char* batch : {"1", "2", "0"})
    ASSERT_EQ(
        graupel("generate " + recipe_ + " --device cuda --batch " + batch + " -o " + folder_.file(batch)).exit_code, 0);
  expect_same("1", "2");
  expect_same("1", "0");
}

}  // namespace
}  // namespace graupel::test
