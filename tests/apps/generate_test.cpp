// Data sets: the same bytes whatever the sharding, complete scenes skipped, other recipes refused.
#include <gtest/gtest.h>

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

  // A second run has nothing to do; another seed is refused.
  const auto stamp = std::filesystem::last_write_time(whole + "/train.h5");
  ASSERT_EQ(graupel("generate " + recipe_flags + " -o " + whole).exit_code, 0);
  EXPECT_EQ(std::filesystem::last_write_time(whole + "/train.h5"), stamp);
  EXPECT_EQ(graupel("generate " + recipe_flags + " --seed 6 -o " + whole).exit_code, 2);
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
