// Ctrl-C and SIGTERM end every verb within a second, with exit code 130 and without half files.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/child.h"

namespace graupel::test {
namespace {

/// The second that is promised, and what a busy machine takes beside it [s].
constexpr double soon = 1.0 + 1.5;

class Stop : public ::testing::Test {
 protected:
  /// Ends a verb that has run for a while.
  void expect_ends(const std::string& arguments, double after, int signal = SIGINT) const {
    Child child(folder_, arguments);
    ASSERT_FALSE(child.ends_within(after)) << arguments << "\n" << child.errors();
    child.send(signal);
    ASSERT_TRUE(child.ends_within(soon)) << arguments;
    EXPECT_EQ(child.exit_code(), 130) << arguments << "\n" << child.errors();
    EXPECT_NE(child.errors().find("interrupted"), std::string::npos) << arguments << "\n" << child.errors();
  }
  std::vector<std::string> half_files() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.file(".")))
      if (entry.path().string().find(".part") != std::string::npos && !std::filesystem::is_directory(entry) &&
          entry.path().extension() == ".part")
        found.push_back(entry.path());
    return found;
  }

  Folder folder_;
  std::string scene_ = folder_.write("scene.json", small_scene());
};

/// A frame of a million substeps.
const std::string long_frame =
    " --threads 1 --device cpu --set time_step.policy=fixed --set time_step.substeps_per_frame=1000000";

TEST_F(Stop, ReadingAPipe) {
  for (const char* name : {"a.json", "a.safetensors", "a.state"}) {
    const std::string pipe = folder_.file(name);
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    for (const std::string verb : {"inspect ", "validate "}) expect_ends(verb + pipe, 0.5, SIGTERM);
  }
  expect_ends("simulate " + folder_.file("a.json"), 0.5);
  expect_ends("rollout " + folder_.file("a.safetensors") + " " + scene_, 0.5);
  expect_ends("generate " + folder_.file("a.json") + " -o " + folder_.file("d"), 0.5);
}

TEST_F(Stop, ALongFrame) {
  for (const int signal : {SIGINT, SIGTERM})
    expect_ends("simulate " + scene_ + long_frame + " -o " + folder_.file("a.h5"), 1, signal);
  std::filesystem::remove(folder_.file("a.h5.part"));  // the frames so far, to be recovered
  expect_ends("compare --scenes " + scene_ + long_frame + " --models mpm --no-floors", 1);
  expect_ends("generate scenes/recipes/hgn.json -o " + folder_.file("d") + long_frame + " --set counts.train=1", 3);
  EXPECT_EQ(half_files(), std::vector<std::string>());
}

TEST_F(Stop, GridsAndPlacesOfManyObstacles) {
  expect_ends("generate scenes/recipes/hgn.json --threads 1 -o " + folder_.file("d") +
                  " --set obstacles.count=1000 --set counts.train=1",
              1);
  const std::string fine = " --set domain.dx=0.003 --threads 1 --device cpu";
  expect_ends("simulate scenes/shared/mixed_torus.json --dry-run" + fine, 1);
  EXPECT_EQ(half_files(), std::vector<std::string>());
}

TEST_F(Stop, TheViewerIsEndedSo) {
  const std::string pipe = folder_.file("a.json");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& arguments : {"view " + scene_ + long_frame, "view " + pipe}) {
    Child child(folder_, arguments);
    ASSERT_FALSE(child.ends_within(1)) << arguments << "\n" << child.errors();
    child.send(SIGTERM);
    ASSERT_TRUE(child.ends_within(soon)) << arguments;
    EXPECT_EQ(child.exit_code(), 0) << arguments << "\n" << child.errors();
    EXPECT_EQ(child.errors().find("interrupted"), std::string::npos) << arguments << "\n" << child.errors();
  }
}

TEST_F(Stop, AnExport) {
  const std::string run = folder_.file("a.h5");
  ASSERT_EQ(graupel("simulate scenes/shared/water_steps.json --device cpu --frames 40 -o " + run).exit_code, 0);
  for (const char* format : {"vtp", "usda"})
    expect_ends("export " + run + " --surface --voxel 0.003 --threads 1 -f " + format + " -o " + folder_.file(format),
                1.5);
  EXPECT_EQ(half_files(), std::vector<std::string>());
}

/// The state of the last whole frame is saved, although the present one would take minutes.
TEST_F(Stop, ALongFrameWithASavedState) {
  const std::string state = folder_.file("a.state"), run = folder_.file("a.h5"), whole = folder_.file("b.h5");
  const std::string steps =
      " --threads 1 --device cpu --frames 12 --set time_step.policy=fixed --set time_step.substeps_per_frame=";
  expect_ends("simulate " + scene_ + steps + "1000000 -o " + run + " --save-state " + state, 1);
  EXPECT_EQ(io::read_state_file(state).frame, 0);
  // A second or so a frame: the run stops within one, and goes on as if it had not.
  const std::string second = steps + "3000 --set frame_time=0.3 -o ";
  expect_ends("simulate " + scene_ + second + run + " --save-state " + state, 1.2);
  const int64_t frame = io::read_state_file(state).frame;
  EXPECT_LT(frame, 12);
  ASSERT_EQ(graupel("simulate --resume " + state + " --threads 1").exit_code, 0);
  ASSERT_EQ(graupel("simulate " + scene_ + second + whole).exit_code, 0);
  const Trajectory a = io::TrajectoryReader(run).read(0, {}), b = io::TrajectoryReader(whole).read(0, {});
  ASSERT_EQ(a.frame_count(), b.frame_count());
  for (std::size_t f = 0; f < a.frame_count(); ++f) EXPECT_TRUE(a.frames[f].position == b.frames[f].position) << f;
}

TEST_F(Stop, BatchSystemsAreToldToStartAgain) {
  const std::string state = folder_.file("a.state");
  Child child(folder_, "simulate " + scene_ + long_frame + " -o " + folder_.file("a.h5") + " --save-state " + state);
  ASSERT_FALSE(child.ends_within(1)) << child.errors();
  child.send(SIGUSR1);
  ASSERT_TRUE(child.ends_within(soon));
  EXPECT_EQ(child.exit_code(), 75) << child.errors();
  EXPECT_TRUE(std::filesystem::exists(state));
  Child keeps_nothing(folder_, "simulate " + scene_ + long_frame + " -o " + folder_.file("b.h5"));
  ASSERT_FALSE(keeps_nothing.ends_within(1)) << keeps_nothing.errors();
  keeps_nothing.send(SIGUSR1);
  ASSERT_TRUE(keeps_nothing.ends_within(soon));
  EXPECT_EQ(keeps_nothing.exit_code(), 130) << keeps_nothing.errors();
}

}  // namespace
}  // namespace graupel::test
