// simulate, rollout and export end to end on a small scene.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/system/atomic_file.h"
#include "experiments/simulation/run_estimate.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

TEST(Simulate, WritesEveryFrameAndTheSameBytesForAnyNumberOfThreads) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const Outcome one = graupel("simulate " + scene + " -o " + folder.file("one.h5") +
                              " --device cpu --threads 1 --json " + folder.file("one.json"));
  ASSERT_EQ(one.exit_code, 0) << one.output;
  ASSERT_EQ(graupel("simulate " + scene + " -o " + folder.file("two.h5") + " --device cpu --threads 2").exit_code, 0);
  const Trajectory a = io::TrajectoryReader(folder.file("one.h5")).read(0),
                   b = io::TrajectoryReader(folder.file("two.h5")).read(0);
  ASSERT_EQ(a.frame_count(), 13u);
  ASSERT_EQ(a.particle_count(), 885u);  // int(8 * 0.15^3 / dx^3 + 1)
  for (std::size_t f = 0; f < a.frame_count(); ++f)
    for (std::size_t p = 0; p < a.particle_count(); ++p)
      ASSERT_TRUE(a.frames[f].position[p] == b.frames[f].position[p]);
  std::ifstream stream(folder.file("one.json"));
  const auto json = nlohmann::json::parse(stream);
  EXPECT_EQ(json["particles"], 885);
  EXPECT_GT(json["updates_per_second"], 0);
}

TEST(Simulate, WarnsOfEmittersAndSinksThatDoNothing) {
  const Folder folder;
  const auto scene = folder.write("idle.json", small_scene(R"("emitters": [ { "shape": "box", "size": [0.1, 0.1, 0.1],
    "position": [0.3, 0.8, 0.3], "material": "water", "velocity": [0, -1, 0], "start_time": 7, "end_time": 7.1 } ],
    "sinks": [ { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [5, 5, 5] } ])"));
  const Outcome idle = graupel("simulate " + scene + " --frames 1 -o " + folder.file("a.h5"));
  EXPECT_EQ(idle.exit_code, 0) << idle.output;
  EXPECT_TRUE(idle.says("the emitters sent out no particle: the first comes at 7 s")) << idle.output;
  EXPECT_TRUE(idle.says("no particle reached a sink")) << idle.output;
  const Outcome busy = graupel("simulate " + scene +
                               " --set emitters.0.start_time=0 --set sinks.0.position=[0.5,0.5,0.5] "
                               "--frames 2 -o " +
                               folder.file("b.h5"));
  EXPECT_FALSE(busy.says("no particle")) << busy.output;
}

TEST(Simulate, WarnsOfFrictionWhereMatterSticks) {
  const Folder folder;
  const auto scene = folder.write("rough.json", small_scene(R"("obstacles": [ { "shape": "sphere", "radius": 0.1,
    "position": [0.5, 0.2, 0.5], "contact": "stick", "friction": 0.3 } ])"));
  const std::string run = "simulate " + scene + " --frames 1 -o ";
  const Outcome sticks =
      graupel(run + folder.file("a.h5") + " --set domain.walls=stick --set domain.wall_friction=0.2");
  EXPECT_EQ(sticks.exit_code, 0) << sticks.output;
  EXPECT_TRUE(sticks.says("obstacle 0: 'friction' (0.3) has no effect, 'contact' is \"stick\"")) << sticks.output;
  EXPECT_TRUE(sticks.says("'wall_friction' (0.2) has no effect")) << sticks.output;
  const Outcome slips =
      graupel(run + folder.file("b.h5") + " --set domain.wall_friction=0.2 --set obstacles.0.contact=slip");
  EXPECT_EQ(slips.exit_code, 0) << slips.output;
  EXPECT_FALSE(slips.says("has no effect")) << slips.output;
}

TEST(Simulate, DryRunPrintsCostsAndWritesNothing) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const Outcome outcome = graupel("simulate " + scene + " --dry-run -o " + folder.file("a.h5"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  for (const char* word :
       {"particles", "885", "substeps", "memory", "of it the domain", "13 bytes each", "disk", "time"})
    EXPECT_TRUE(outcome.says(word)) << word;
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.h5")));
}

TEST(Simulate, AnEmptyDomainOfGigabytesIsRemarkedOn) {
  Scene scene = io::parse_scene(small_scene(), "scene", ".");
  EXPECT_EQ(experiments::remark_on_memory(scene, {}), "");
  scene.domain.size = {60, 60, 60};
  scene.domain.dx = 1.0 / 64;
  const std::string remark = experiments::remark_on_memory(scene, {});
  EXPECT_NE(remark.find("the domain takes 11.6 GB of memory"), std::string::npos) << remark;
  EXPECT_NE(remark.find("8.9e+08 grid blocks of 4^3 nodes, 13 bytes each"), std::string::npos) << remark;
  scene.sources[0].size = {30, 30, 10};  // as much for the matter
  EXPECT_EQ(experiments::remark_on_memory(scene, {}), "");
}

TEST(Simulate, KilledRunIsRecoveredFrameByFrame) {
  const Folder folder;
  const auto scene =
      folder.write("small.json", small_scene("  \"time_step\": { \"policy\": \"fixed\", \"substeps_per_frame\": 60 }"));
  const std::string out = folder.file("a.h5");
  ASSERT_EQ(graupel("simulate " + scene + " -o " + folder.file("whole.h5") + " --frames 40 --device cpu").exit_code, 0);
  const pid_t child = ::fork();
  if (child == 0) {
    if (std::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(126);
    ::execl(GRAUPEL_BINARY_DIR "/graupel", "graupel", "simulate", scene.c_str(), "-o", out.c_str(), "--frames",
            "100000", "--device", "cpu", nullptr);
    ::_exit(127);
  }
  // Wait until a few flushes have happened, then end the run as the out-of-memory killer would.
  for (int i = 0;
       i < 300 && !(std::filesystem::exists(out + ".part") && std::filesystem::file_size(out + ".part") > 200000); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const Outcome early = graupel("inspect --recover " + out), second = graupel("simulate " + scene + " -o " + out);
  EXPECT_EQ(early.exit_code, 3);
  EXPECT_TRUE(early.says("still being written")) << early.output;
  EXPECT_EQ(second.exit_code, 5);
  EXPECT_TRUE(second.says("another run")) << second.output;
  ::kill(child, SIGKILL);
  int status = 0;
  ::waitpid(child, &status, 0);
  const Outcome outcome = graupel("inspect --recover " + out);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Trajectory recovered = io::TrajectoryReader(out).read(0),
                   whole = io::TrajectoryReader(folder.file("whole.h5")).read(0);
  ASSERT_GE(recovered.frame_count(), 8u);
  EXPECT_TRUE(graupel("inspect " + out).says("recovered: true"));
  EXPECT_FALSE(graupel("inspect " + folder.file("whole.h5")).says("recovered"));
  for (std::size_t f = 0; f < std::min(recovered.frame_count(), whole.frame_count()); ++f)
    for (std::size_t p = 0; p < whole.particle_count(); ++p)
      ASSERT_TRUE(recovered.frames[f].position[p] == whole.frames[f].position[p]) << f;
}

TEST(Simulate, InterruptExitsWith130) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  const std::string said = folder.file("said.txt"), out = folder.file("a.h5");
  const pid_t child = ::fork();
  if (child == 0) {
    if (std::freopen(said.c_str(), "w", stderr) == nullptr) ::_exit(126);
    ::execl(GRAUPEL_BINARY_DIR "/graupel", "graupel", "simulate", scene.c_str(), "-o", out.c_str(), "--frames",
            "100000", "--device", "cpu", nullptr);
    ::_exit(127);
  }
  for (int i = 0; i < 200 && !std::filesystem::exists(out + ".part"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));  // long enough for a line that says "done"
  ::kill(child, SIGINT);
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  const std::string text = read_file(said);
  EXPECT_NE(text.find("interrupted; '" + out + ".part' holds"), std::string::npos) << text;
  EXPECT_NE(text.find("graupel inspect --recover " + out), std::string::npos) << text;
  EXPECT_EQ(text.find("done"), std::string::npos) << text;
}

TEST(Export, EveryFormat) {
  const Folder folder;
  const auto scene = folder.write("small.json", small_scene());
  ASSERT_EQ(graupel("simulate " + scene + " -o " + folder.file("a.h5") + " --frames 2").exit_code, 0);
  for (const char* format : {"vtp", "ply", "vdb"}) {
    const std::string target = folder.file(format);
    const Outcome outcome = graupel("export " + folder.file("a.h5") + " --format " + format + " -o " + target);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    int files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(target)) ++files;
    EXPECT_GE(files, 3) << format;
  }
}

}  // namespace
}  // namespace graupel::test
