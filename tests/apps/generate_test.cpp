// Data sets: the same bytes whatever the sharding, complete scenes skipped, other recipes refused.
#include <gtest/gtest.h>

#include <future>

#include "core/atomic_file.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "sparsegrid/obstacle_set.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

const std::string recipe_flags =
    "scenes/recipes/hgn.json --set frames=3 --set counts.train=3 --set counts.valid=1 --set counts.test=1 --device cpu "
    "--seed 5";

TEST(Generate, ShardsMakeTheSameBytesAsOneRun) {
  const Folder folder;
  const std::string whole = folder.file("whole"), shards = folder.file("shards");
  const Outcome one = graupel("generate " + recipe_flags + " --threads 2 -o " + whole);
  ASSERT_EQ(one.exit_code, 0) << one.output;
  ASSERT_EQ(graupel("generate " + recipe_flags + " --shard 1/2 --threads 1 -o " + shards).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(shards + "/train.h5"));
  ASSERT_EQ(graupel("generate " + recipe_flags + " --shard 0/2 --threads 1 -o " + shards).exit_code, 0);
  for (const char* name : {"train.h5", "valid.h5", "test.h5", "metadata.json"})
    EXPECT_TRUE(read_file(whole + "/" + name) == read_file(shards + "/" + name)) << name << " differs";
  EXPECT_FALSE(std::filesystem::exists(whole + "/parts"));

  EXPECT_FALSE(std::filesystem::exists(whole + "/.lock"));

  // A second run has nothing to do; another seed or device is refused.
  const auto stamp = std::filesystem::last_write_time(whole + "/train.h5");
  ASSERT_EQ(graupel("generate " + recipe_flags + " -o " + whole).exit_code, 0);
  EXPECT_EQ(std::filesystem::last_write_time(whole + "/train.h5"), stamp);
  EXPECT_EQ(graupel("generate " + recipe_flags + " --seed 6 -o " + whole).exit_code, 2);
  std::string card = read_file(whole + "/dataset.json");
  card.replace(card.find("\"cpu\""), 5, "\"cuda\"");
  write_file_atomically(whole + "/dataset.json", card);
  const Outcome other = graupel("generate " + recipe_flags + " -o " + whole);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_TRUE(other.says("another device (there cuda, here cpu)")) << other.output;
}

TEST(Generate, ShardsAtOnceMakeTheSameBytesAsOneRun) {
  const Folder folder;
  const std::string whole = folder.file("whole"), shards = folder.file("shards");
  const std::string flags = recipe_flags + " --set frames=2 --threads 1 -o ";
  ASSERT_EQ(graupel("generate " + flags + whole).exit_code, 0);
  std::vector<std::future<Outcome>> runs;
  for (int i = 0; i < 5; ++i)  // five scenes: all end, and want to merge, at about the same time
    runs.push_back(std::async(std::launch::async, [&, i] {
      return graupel("generate " + flags + shards + " --shard " + std::to_string(i) + "/5");
    }));
  for (auto& run : runs) {
    const Outcome outcome = run.get();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  }
  for (const char* name : {"train.h5", "valid.h5", "test.h5", "metadata.json"})
    EXPECT_TRUE(read_file(whole + "/" + name) == read_file(shards + "/" + name)) << name << " differs";
  EXPECT_EQ(names_in(shards), names_in(whole));  // nothing is left behind
}

TEST(Generate, ALogThatCannotBeWrittenIsAnIoError) {
  const Folder folder;
  const std::string whole = folder.file("whole");
  std::filesystem::create_directories(whole + "/redrawn.jsonl");  // a folder in the log's place
  // One substep a frame is far too few: the scene diverges and is redrawn.
  const Outcome outcome = graupel("generate " + recipe_flags +
                                  " --set time_step.policy=fixed --set time_step.substeps_per_frame=1 -o " + whole);
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("redrawn.jsonl")) << outcome.output;
}

TEST(Generate, ScenesFollowTheRecipe) {
  const Folder folder;
  const std::string whole = folder.file("whole");
  ASSERT_EQ(graupel("generate " + recipe_flags + " -o " + whole).exit_code, 0);
  const io::TrajectoryReader reader(whole + "/train.h5");
  ASSERT_EQ(reader.count(), 3);
  for (int i = 0; i < reader.count(); ++i) {
    const Trajectory t = reader.read(i);
    EXPECT_EQ(reader.attribute(i, "recipe"), "hgn");
    EXPECT_EQ(reader.attribute(i, "recipe_seed"), "5");
    EXPECT_GE(t.particle_count(), 4 * 563u);   // four spheres
    EXPECT_LE(t.particle_count(), 4 * 1074u);  // four cubes
    const Scene scene = io::parse_scene(t.scene_json, "stored", ".");
    EXPECT_EQ(scene.obstacles.size(), 5u);
    EXPECT_EQ(scene.sources.size(), 4u);
    const sparsegrid::ObstacleSet obstacles(scene);
    for (const ParticleFrame& frame : t.frames)
      for (const Vec3f& x : frame.position) ASSERT_GE(obstacles.sample(x.cast<double>()).phi, -1e-4 * scene.domain.dx);
  }
}

}  // namespace
}  // namespace graupel::test
