// Data sets: the same bytes whatever the sharding, complete scenes skipped, other recipes refused.
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <algorithm>
#include <future>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "sparsegrid/obstacle_set.h"
#include "tests/apps/program.h"
#include "tests/gpu_only.h"

namespace graupel::test {
namespace {

const std::string recipe_flags =
    "scenes/recipes/hgn.json --set frames=3 --set counts.train=3 --set counts.valid=1 --set counts.test=1 --device cpu "
    "--seed 5";

Outcome with_another_seed(std::string flags) {
  flags.replace(flags.find("--seed 5"), 8, "--seed 6");
  return graupel("generate " + flags);
}

/// The one that merges takes away the folder of parts, which the others may be about to write to. One that would write
/// a part that another one writes ends.
TEST(Generate, SeveralRunsOfOneSetAtOnceEndWellOrSayWhy) {
  const Folder folder;
  std::vector<std::future<Outcome>> runs;
  for (int i = 0; i < 3; ++i)
    runs.push_back(std::async(std::launch::async, [&] {
      return graupel("generate " + recipe_flags + " --threads 1 -o " + folder.file("set"));
    }));
  for (auto& run : runs) {
    const Outcome outcome = run.get();
    EXPECT_TRUE(outcome.exit_code == 0 || (outcome.exit_code == 5 && outcome.says("another run is writing")))
        << outcome.output;
  }
  ASSERT_EQ(graupel("generate " + recipe_flags + " --threads 1 -o " + folder.file("set")).exit_code, 0);
  EXPECT_EQ(io::TrajectoryReader(folder.file("set") + "/train.h5").count(), 3);
}

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

  // The card tells the time of the run; that of both shards is on other threads.
  const auto made_in = [](const std::string& set) {
    return nlohmann::json::parse(read_file(set + "/dataset.json")).at("made_in");
  };
  const nlohmann::json time = made_in(whole);
  ASSERT_EQ(time.size(), 1u);
  EXPECT_GT(time[0].at("seconds").get<double>(), 0);
  EXPECT_EQ(time[0].at("device"), hardware_name(Device::cpu, 2));
  ASSERT_EQ(made_in(shards).size(), 1u);
  EXPECT_EQ(made_in(shards)[0].at("device"), hardware_name(Device::cpu, 1));

  // A second run has nothing to do; another seed or device is refused.
  const auto stamp = std::filesystem::last_write_time(whole + "/train.h5");
  ASSERT_EQ(graupel("generate " + recipe_flags + " -o " + whole).exit_code, 0);
  EXPECT_EQ(std::filesystem::last_write_time(whole + "/train.h5"), stamp);
  EXPECT_EQ(made_in(whole), time);
  const Outcome seed = with_another_seed(recipe_flags + " -o " + whole);
  EXPECT_EQ(seed.exit_code, 2);
  EXPECT_TRUE(seed.says("another recipe or seed")) << seed.output;
  std::string card = read_file(whole + "/dataset.json");
  card.replace(card.find("\"cpu\""), 5, "\"cuda\"");
  write_file_atomically(whole + "/dataset.json", card);
  const Outcome other = graupel("generate " + recipe_flags + " -o " + whole);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_TRUE(other.says("another device (there cuda, here cpu)")) << other.output;
}

TEST(Generate, DamagedPartsAreMadeAgain) {
  const Folder folder;
  const std::string whole = folder.file("whole"), set = folder.file("set"), card = set + "/dataset.json";
  ASSERT_EQ(graupel("generate " + recipe_flags + " -o " + whole).exit_code, 0);
  ASSERT_EQ(graupel("generate " + recipe_flags + " --shard 1/2 -o " + set).exit_code, 0);
  const std::string facts = read_file(card), part = set + "/parts/" + names_in(set + "/parts").front();
  std::string bytes = read_file(part);
  bytes.replace(bytes.size() / 2, 64, std::string(64, '\xff'));
  write_file_atomically(part, bytes);

  write_file_atomically(card, "{");
  const Outcome no_card = graupel("generate " + recipe_flags + " -o " + set);
  EXPECT_EQ(no_card.exit_code, 3) << no_card.output;
  EXPECT_TRUE(no_card.says("dataset.json' is damaged") && no_card.says("Remove it")) << no_card.output;

  write_file_atomically(card, facts);
  const Outcome again = graupel("generate " + recipe_flags + " -o " + set);
  EXPECT_EQ(again.exit_code, 0) << again.output;
  EXPECT_TRUE(again.says(part + "' is damaged and is made again")) << again.output;
  for (const char* name : {"train.h5", "valid.h5", "test.h5"})
    EXPECT_TRUE(read_file(whole + "/" + name) == read_file(set + "/" + name)) << name << " differs";
}

TEST(Generate, ACompleteSetStaysAsItIs) {
  const Folder folder;
  const std::string set = folder.file("set"), flags = recipe_flags + " --set counts.train=1 -o " + set;
  ASSERT_EQ(graupel("generate " + flags).exit_code, 0);
  const auto before = names_in(set);
  const Outcome again = graupel("generate " + flags), other = with_another_seed(flags);
  EXPECT_EQ(again.exit_code, 0) << again.output;
  EXPECT_EQ(other.exit_code, 2) << other.output;
  EXPECT_TRUE(other.says("another recipe or seed")) << other.output;
  EXPECT_EQ(names_in(set), before);  // no folder of parts, no lock
}

TEST(Generate, ARecipeWithoutScenesIsRefused) {
  const Folder folder;
  const std::string counts = " --set counts.train=0 --set counts.valid=0 --set counts.test=0";
  for (const std::string more : {"", " --emit-slurm 2"}) {
    const Outcome none = graupel("generate " + recipe_flags + counts + more + " -o " + folder.file("set"));
    EXPECT_EQ(none.exit_code, 2) << none.output;
    EXPECT_TRUE(none.says("scenes/recipes/hgn.json' has no scenes") && none.says("counts.train") &&
                none.says("allowed: 1 or more") && none.says("--set counts.train=N"))
        << none.output;
    EXPECT_FALSE(std::filesystem::exists(folder.file("set")));
  }
}

/// Groups of two materials at speed, by one thread and by two shards; another seed gives others.
TEST(Generate, LargeScenesHaveTheSameBytesForASeed) {
  const Folder folder;
  const std::string flags =
      "generate scenes/recipes/hgn_large.json --set frames=1 --set counts.train=2 --set counts.valid=0 --set "
      "counts.test=0 --set domain.size=[1,1,1] --set groups.count=6 --set obstacles.count=4 --set "
      "time_step.substeps_per_frame=4 --set frame_time=0.0012 --device cpu ";
  const std::string one = folder.file("one"), two = folder.file("two"), other = folder.file("other");
  ASSERT_EQ(graupel(flags + "--seed 3 --threads 1 -o " + one).exit_code, 0);
  ASSERT_EQ(graupel(flags + "--seed 3 --threads 2 --shard 1/2 -o " + two).exit_code, 0);
  ASSERT_EQ(graupel(flags + "--seed 3 --threads 2 --shard 0/2 -o " + two).exit_code, 0);
  ASSERT_EQ(graupel(flags + "--seed 4 -o " + other).exit_code, 0);
  for (const char* name : {"/train.h5", "/metadata.json"})
    EXPECT_TRUE(read_file(one + name) == read_file(two + name)) << name << " differs";
  EXPECT_FALSE(read_file(one + "/train.h5") == read_file(other + "/train.h5"));
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

/// Makes the set with `flags`, and parts of it with other batches, shards and after a kill: all have the same bytes.
void expect_same_bytes_for_every_batch(const std::string& flags) {
  const Folder folder;
  const std::string whole = folder.file("whole");
  const Outcome one = graupel("generate " + flags + " --batch 1 -o " + whole);
  ASSERT_EQ(one.exit_code, 0) << one.output;
  const auto expect_whole = [&](const std::string& made) {
    for (const char* name : {"train.h5", "valid.h5", "test.h5", "metadata.json"})
      EXPECT_TRUE(read_file(whole + "/" + name) == read_file(made + "/" + name)) << made << "/" << name << " differs";
    EXPECT_EQ(names_in(made), names_in(whole));
  };
  for (const char* batch : {"3", "100"}) {
    const std::string made = folder.file(std::string("batch") + batch);
    const Outcome outcome = graupel("generate " + flags + " --batch " + batch + " -o " + made);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
    expect_whole(made);
  }
  const std::string shards = folder.file("shards");
  for (const char* shard : {"1/2", "0/2"})
    ASSERT_EQ(graupel("generate " + flags + " --batch 2 --shard " + shard + " -o " + shards).exit_code, 0);
  expect_whole(shards);

  // What a kill leaves: some scenes, and a piece of one that is taken for nothing.
  const std::string killed = folder.file("killed");
  ASSERT_EQ(graupel("generate " + flags + " --shard 0/2 -o " + killed).exit_code, 0);
  folder.write("killed/parts/train-00001.h5.part", "half a file");
  folder.write("killed/parts/train-00002.h5", "not HDF5");
  const Outcome resumed = graupel("generate " + flags + " --batch 3 -o " + killed);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;
  EXPECT_TRUE(resumed.says("scenes are there already")) << resumed.output;
  expect_whole(killed);
}

/// The stored scene, run by `simulate`, has the bytes of its trajectory in the set.
void expect_scenes_equal_simulate(const std::string& flags, const std::string& device) {
  const Folder folder;
  const std::string whole = folder.file("whole");
  ASSERT_EQ(graupel("generate " + flags + " -o " + whole).exit_code, 0);
  const io::TrajectoryReader set(whole + "/train.h5");
  for (int i = 0; i < set.count(); ++i) {
    const Trajectory made = set.read(i);
    const std::string scene = folder.write("scene.json", made.scene_json), out = folder.file("alone.h5");
    const Outcome alone = graupel("simulate " + scene + " --no-velocity --seed " + std::to_string(made.seed) +
                                  " --device " + device + " -o " + out);
    ASSERT_EQ(alone.exit_code, 0) << alone.output;
    const io::TrajectoryReader reader(out);
    const Trajectory single = reader.read(0);
    EXPECT_EQ(made.particle_type, single.particle_type);
    EXPECT_EQ(set.initial_velocity(i), reader.initial_velocity(0));
    ASSERT_EQ(made.frame_count(), single.frame_count());
    for (std::size_t f = 0; f < made.frame_count(); ++f) {
      EXPECT_EQ(made.frames[f].time, single.frames[f].time);
      EXPECT_TRUE(made.frames[f].position == single.frames[f].position) << "scene " << i << ", frame " << f;
    }
  }
}

const std::string batch_recipe =
    "scenes/recipes/hgn.json --set frames=9 --set time_step.substeps_per_frame=8 --set frame_time=0.0024 --set "
    "counts.train=3 --set counts.valid=1 --set counts.test=1 --seed 5";

TEST(Generate, BytesDoNotDependOnTheBatchOnTheCpu) {
  expect_same_bytes_for_every_batch(batch_recipe + " --device cpu --threads 2");
}
TEST(Generate, BytesDoNotDependOnTheBatchOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_same_bytes_for_every_batch(batch_recipe + " --device cuda");
}
TEST(Generate, ScenesEqualTheirSingleRunOnTheCpu) {
  expect_scenes_equal_simulate(batch_recipe + " --device cpu --batch 3", "cpu");
}
TEST(Generate, ScenesEqualTheirSingleRunOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_scenes_equal_simulate(batch_recipe + " --device cuda --batch 3", "cuda");
}

/// With so few substeps some scenes diverge: they are redrawn, and their neighbours in a batch are as they were.
void expect_same_redraws_for_every_batch(const std::string& device) {
  const Folder folder;
  std::vector<std::string> log[2], sets;
  for (const char* batch : {"1", "4"}) {
    sets.push_back(folder.file(std::string("batch") + batch));
    const Outcome outcome = graupel(
        "generate scenes/recipes/hgn.json --set frames=4 --set time_step.substeps_per_frame=22 --set "
        "groups.max_speed=6 "
        "--set counts.train=4 --set counts.valid=1 --set counts.test=1 --seed 5 --threads 2 --device " +
        device + " --batch " + batch + " -o " + sets.back());
    ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
    std::istringstream lines(read_file(sets.back() + "/redrawn.jsonl"));
    for (std::string line; std::getline(lines, line);) log[sets.size() - 1].push_back(line);
    std::sort(log[sets.size() - 1].begin(), log[sets.size() - 1].end());
  }
  EXPECT_GT(log[0].size(), 1u);
  EXPECT_EQ(log[0], log[1]);
  for (const char* name : {"train.h5", "valid.h5", "test.h5", "metadata.json"})
    EXPECT_TRUE(read_file(sets[0] + "/" + name) == read_file(sets[1] + "/" + name)) << name << " differs";
}

TEST(Generate, DivergedScenesAreRedrawnTheSameInEveryBatchOnTheCpu) { expect_same_redraws_for_every_batch("cpu"); }
TEST(Generate, DivergedScenesAreRedrawnTheSameInEveryBatchOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_same_redraws_for_every_batch("cuda");
}

/// A scene of each category, with the fields that the recipe names; the same bytes by shards. Small scenes.
TEST(Generate, CategoriesAreDrawnInTurnAndRecorded) {
  const Folder folder;
  const std::string whole = folder.file("whole"), shards = folder.file("shards");
  const std::string flags =
      "generate scenes/recipes/general.json --set frames=2 --set max_particles=800 --set "
      "time_step.substeps_per_frame=50 "
      "--set counts.train=8 --set counts.valid=0 --set counts.test=1 --seed 5 --device cpu -o ";
  const Outcome outcome = graupel(flags + whole + " --threads 2");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  for (const char* shard : {"1/2", "0/2"}) ASSERT_EQ(graupel(flags + shards + " --shard " + shard).exit_code, 0);
  for (const char* name : {"train.h5", "test.h5", "metadata.json"})
    EXPECT_TRUE(read_file(whole + "/" + name) == read_file(shards + "/" + name)) << name << " differs";

  const io::TrajectoryReader reader(whole + "/train.h5");
  ASSERT_EQ(reader.count(), 8);
  const char* categories[] = {"dam_break",   "column_collapse", "fall_on_obstacles", "thrown_bodies",
                              "snow_impact", "stream",          "moving_obstacle",   "filling_container"};
  for (int i = 0; i < reader.count(); ++i) {
    const Scene scene = io::parse_scene(reader.read(i).scene_json, "stored", ".");
    EXPECT_EQ(scene.name, "general-train-0000" + std::to_string(i) + "-" + categories[i]);
    EXPECT_EQ(reader.fields(i).names(), "affine,plastic");
    EXPECT_LE(reader.read(i).particle_count(), 800u);
    EXPECT_EQ(reader.attribute(i, "recipe"), "general");
  }
  EXPECT_EQ(graupel(flags + whole + " --fields plastic").exit_code, 2);  // the folder has other fields
  const Outcome wrong = graupel(flags + folder.file("none") + " --set bodies.speed=[4,1]");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(wrong.says("/bodies/speed")) << wrong.output;
  const Outcome fast = graupel(flags + folder.file("none") + " --set streams.speed=[1,900]");
  EXPECT_EQ(fast.exit_code, 2);
  EXPECT_TRUE(fast.says("'scenes/recipes/general.json': recipe key 'time_step.substeps_per_frame'")) << fast.output;
}

TEST(Generate, AStoppedRunLeavesNoPieces) {
  const Folder folder;
  const std::string set = folder.file("set");
  const std::string flags = recipe_flags + " --set frames=400 --set counts.train=2 --threads 2 -o " + set;
  const Outcome stopped = graupel("generate " + flags + " & pid=$!; sleep 2; kill -INT $pid; wait $pid");
  EXPECT_EQ(stopped.exit_code, 130) << stopped.output;
  for (const std::string& name : names_in(set + "/parts")) EXPECT_EQ(name.find(".part"), std::string::npos) << name;
}

TEST(Generate, AFullDiskIsAnIoErrorAndLeavesNoWholeScene) {
  const Folder folder;
  const std::string disk = folder.file("tiny");
  std::filesystem::create_directory(disk);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=256k") != 0)
    GTEST_SKIP() << "no tmpfs can be mounted here (needs root): disk-full is not tested";
  const Outcome outcome =
      graupel("generate " + batch_recipe + " --device cpu --batch 3 --set frames=20 -o " + disk + "/set");
  const std::vector<std::string> left = names_in(disk + "/set/parts");
  ::umount(disk.c_str());
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("disk full")) << outcome.output;
  EXPECT_EQ(std::count_if(left.begin(), left.end(), [](const std::string& name) { return name.ends_with(".h5"); }), 0);
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
