// simulate --save-state and --resume: the same data as an uninterrupted run, however the first one ended.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/parallel/device.h"
#include "core/system/atomic_file.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

const FieldSet all_fields = {ParticleField::stress, ParticleField::affine, ParticleField::deformation_gradient,
                             ParticleField::plastic};

/// Two materials, an emitter, a sink and a moving obstacle.
std::string busy_scene(const std::string& name = "busy") {
  return "{ \"name\": \"" + name + R"(",
  "domain": { "dx": 0.03125 },
  "materials": { "snow": { "preset": "taichi_snow" }, "sand": { "preset": "taichi_sand" } },
  "sources": [ { "shape": "box", "size": [0.12, 0.12, 0.12], "position": [0.6, 0.2, 0.5], "velocity": [0.2, -2, 0],
                 "material": "snow" } ],
  "emitters": [ { "shape": "box", "size": [0.1, 0.04, 0.1], "position": [0.35, 0.42, 0.5], "velocity": [0, -1, 0], "end_time": 1,
                  "material": "sand" } ],
  "sinks": [ { "shape": "box", "position": [0.62, 0.1, 0.5], "size": [0.1, 0.06, 0.2] } ],
  "obstacles": [ { "shape": "box", "size": [0.2, 0.05, 0.2], "position": [0.35, 0.3, 0.5],
                   "motion": { "velocity": [0.2, 1, 0], "spin": 2 } } ],
  "time_step": { "policy": "adaptive" }, "frame_time": 0.01, "frames": 12
})";
}

Trajectory read(const std::string& file) { return io::TrajectoryReader(file).read(0, all_fields); }

void expect_same_datasets(const Trajectory& a, const Trajectory& b) {
  ASSERT_EQ(a.frame_count(), b.frame_count());
  EXPECT_EQ(a.particle_type, b.particle_type);
  EXPECT_EQ(a.scene_json, b.scene_json);
  for (std::size_t f = 0; f < a.frame_count(); ++f) {
    ASSERT_EQ(a.frames[f].time, b.frames[f].time) << f;
    ASSERT_TRUE(a.frames[f].position == b.frames[f].position) << f;
    ASSERT_TRUE(a.frames[f].velocity == b.frames[f].velocity) << f;
    ASSERT_TRUE(a.frames[f].active == b.frames[f].active) << f;
    ASSERT_TRUE(a.frames[f].fields == b.frames[f].fields) << f;
  }
}

pid_t start(const std::vector<std::string>& arguments) {
  const pid_t child = ::fork();
  if (child != 0) return child;
  if (std::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(126);
  std::vector<char*> words;
  std::vector<std::string> all = {"graupel"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  for (std::string& word : all) words.push_back(word.data());
  words.push_back(nullptr);
  ::execv(GRAUPEL_BINARY_DIR "/graupel", words.data());
  ::_exit(127);
}

/// Frame of the state in a file, or -1.
int64_t saved_frame(const std::string& file) {
  return std::filesystem::exists(file) ? io::read_state_file(file).frame : -1;
}

void wait_for_frame(const std::string& state, int64_t frame) {
  for (int i = 0; i < 1200 && saved_frame(state) < frame; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
  ASSERT_GE(saved_frame(state), frame);
}

int end(pid_t child, int signal) {
  ::kill(child, signal);
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

struct Case {
  const char *precision, *threads, *more_threads;
};
class Restart : public testing::TestWithParam<Case> {
 protected:
  // Two threads that spin while another program has the cores take ten times as long.
  void SetUp() override { ::setenv("OMP_WAIT_POLICY", "passive", 1); }
  void TearDown() override { ::unsetenv("OMP_WAIT_POLICY"); }
};

TEST_P(Restart, SomeFramesAndTheRestEqualAllOfThem) {
  const auto [precision, threads, more_threads] = GetParam();
  const Folder folder;
  const std::string scene = folder.write("busy.json", busy_scene()), whole = folder.file("whole.h5"),
                    out = folder.file("a.h5"), state = folder.file("a.state");
  const std::string flags = " --device cpu --fields stress,affine,deformation_gradient,plastic --precision " +
                            std::string(precision) + " --threads ";
  ASSERT_EQ(graupel("simulate " + scene + flags + threads + " -o " + whole).exit_code, 0);
  const Outcome first =
      graupel("simulate " + scene + flags + threads + " --frames 5 -o " + out + " --save-state " + state);
  ASSERT_EQ(first.exit_code, 0) << first.output;
  const Outcome inspected = graupel("inspect " + state);
  EXPECT_EQ(inspected.exit_code, 0) << inspected.output;
  for (const char* fact : {"kind: saved state", "scene: busy", "frame: 5", "device: cpu", "fields: stress,affine"})
    EXPECT_TRUE(inspected.says(fact)) << fact << inspected.output;
  EXPECT_TRUE(inspected.says(std::string("precision: ") + precision));
  // The state says all: scene, seed, precision, fields and output.
  const Outcome rest = graupel("simulate --resume " + state + " --frames 12 --threads " + more_threads + " --json " +
                               folder.file("rest.json"));
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  const Trajectory a = read(whole), b = read(out);
  ASSERT_EQ(a.frame_count(), 13u);
  expect_same_datasets(a, b);
  EXPECT_NE(a.frames.back().active, a.frames.front().active);
  const auto facts = nlohmann::json::parse(read_file(folder.file("rest.json")));
  EXPECT_EQ(facts["resumed_from_frame"], 5);
  for (const char* event : {"pushed_out", "born", "removed"}) EXPECT_GT(facts[event], 0) << event;
}

INSTANTIATE_TEST_SUITE_P(BothPrecisionsAndThreads, Restart,
                         testing::Values(Case{"f32", "2", "1"}, Case{"f32", "1", "2"}, Case{"f64", "1", "1"},
                                         Case{"f64", "2", "2"}));

TEST(RestartOfTwoSands, KeepsTheirMaterials) {
  const Folder folder;
  const std::string scene = folder.write("sands.json", R"({ "name": "sands", "domain": { "dx": 0.03125 }, "frames": 9,
        "materials": { "dry sand": { "preset": "taichi_sand" },
                       "wet": { "preset": "taichi_sand", "friction_angle": 20 } },
        "sources": [
          { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.3, 0.3, 0.5], "material": "dry sand" },
          { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.7, 0.3, 0.5], "material": "wet" } ] })");
  const std::string whole = folder.file("whole.h5"), out = folder.file("a.h5"), state = folder.file("a.state");
  Outcome outcome = graupel("simulate " + scene + " --device cpu --frames 9 -o " + whole);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu --frames 3 -o " + out + " --save-state " + state).exit_code,
            0);
  outcome = graupel("simulate --resume " + state + " --frames 9");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Trajectory a = read(whole), b = read(out);
  expect_same_datasets(a, b);
  EXPECT_EQ(a.materials.names, (std::vector<std::string>{"dry sand", "wet"}));
  EXPECT_EQ(a.materials, b.materials);
  for (std::size_t i = 0; i < a.particle_count(); ++i)
    ASSERT_EQ(a.materials.index[i], a.frames[0].position[i][0] < 0.5f ? 0 : 1) << i;
  outcome = graupel("export " + out + " --surface --format obj --frames 9 -o " + folder.file("obj"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_EQ(names_in(folder.file("obj")),
            (std::vector<std::string>{"a_surface_dry_sand_0009.obj", "a_surface_wet_0009.obj"}));
}

TEST(RestartAfter, AKillBetweenSaves) {
  const Folder folder;
  const std::string scene = folder.write("busy.json", busy_scene()), out = folder.file("a.h5"),
                    state = folder.file("a.state");
  const pid_t child = start({"simulate", scene, "-o", out, "--frames", "100000", "--device", "cpu", "--threads", "1",
                             "--save-state", state, "--save-every", "5"});
  wait_for_frame(state, 10);
  ASSERT_TRUE(WIFSIGNALED(end(child, SIGKILL)));
  const int64_t frames = saved_frame(state) + 7;
  const std::string count = " --threads 1 --frames " + std::to_string(frames);
  const Outcome rest = graupel("simulate --resume " + state + count);
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu -o " + folder.file("whole.h5") + count).exit_code, 0);
  expect_same_datasets(read(folder.file("whole.h5")), read(out));
  EXPECT_FALSE(std::filesystem::exists(out + ".part"));
}

TEST(RestartAfter, ASignalWhichSavesTheStateAndSaysHowToGoOn) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const Folder folder;
    const std::string scene = folder.write("busy.json", busy_scene()), out = folder.file("a.h5"),
                      state = folder.file("a.state");
    const std::string said = folder.file("said.txt");
    const pid_t child = ::fork();
    if (child == 0) {
      if (std::freopen(said.c_str(), "w", stderr) == nullptr) ::_exit(126);
      ::execl(GRAUPEL_BINARY_DIR "/graupel", "graupel", "simulate", scene.c_str(), "-o", out.c_str(), "--frames",
              "100000", "--device", "cpu", "--threads", "1", "--save-state", state.c_str(), nullptr);
      ::_exit(127);
    }
    for (int i = 0;
         i < 400 && !(std::filesystem::exists(out + ".part") && std::filesystem::file_size(out + ".part") > 100000);
         ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(25));
    const int status = end(child, signal);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 130);
    EXPECT_NE(read_file(said).find("graupel simulate --resume " + state), std::string::npos) << read_file(said);
    const int64_t saved = saved_frame(state);
    ASSERT_GE(saved, 1);
    const std::string count = " --threads 1 --frames " + std::to_string(saved + 3);
    ASSERT_EQ(graupel("simulate " + scene + " --resume " + state + " -o " + out + count).exit_code, 0);
    ASSERT_EQ(graupel("simulate " + scene + " --device cpu -o " + folder.file("whole.h5") + count).exit_code, 0);
    expect_same_datasets(read(folder.file("whole.h5")), read(out));
  }
}

class SavedRunErrors : public testing::Test {
 protected:
  void SetUp() override {
    scene = folder.write("busy.json", busy_scene());
    out = folder.file("a.h5");
    state = folder.file("a.state");
    ASSERT_EQ(graupel("simulate " + scene + " --device cpu --frames 3 -o " + out + " --save-state " + state).exit_code,
              0);
  }
  void expect_refused(const std::string& flags, int exit_code, const std::vector<std::string>& words,
                      std::size_t frames_in_trajectory = 4) {
    const std::string frames = flags.find("--frames") == std::string::npos ? " --frames 5 " : " ";
    const Outcome outcome = graupel("simulate --resume " + state + frames + flags);
    EXPECT_EQ(outcome.exit_code, exit_code) << flags << outcome.output;
    for (const std::string& word : words) EXPECT_TRUE(outcome.says(word)) << word << " is not in " << outcome.output;
    EXPECT_EQ(read(out).frame_count(), frames_in_trajectory);
  }
  Folder folder;
  std::string scene, out, state;
};

TEST_F(SavedRunErrors, AnotherSceneSeedPrecisionDeviceOrVersion) {
  std::string text = busy_scene("renamed");  // which is the same scene
  const std::string renamed = folder.write("renamed.json", text);
  text.replace(text.find("\"spin\": 2"), 9, "\"spin\": 3");
  const std::string other = folder.write("other.json", text);
  expect_refused(other, 3, {"other.json", state, "another scene or seed"});
  expect_refused("--set gravity=[0,0,0]", 3, {state, "another scene or seed"});
  expect_refused("--seed 7", 3, {state, "--seed 0", "asked for: 7"});
  expect_refused("--precision f64", 3, {state, "--precision f32"});
  expect_refused("--device cuda", 3, {state, "--device cpu", "asked for: cuda"});
  expect_refused("--fields stress", 3, {state, "--fields nothing", "asked for: stress"});
  expect_refused("--no-velocity", 3, {state, "stores velocities"});
  expect_refused("--frames 2", 2, {state, "is at frame 3", "Use --frames with 3 or more"});
  EXPECT_EQ(graupel("simulate " + renamed + " --resume " + state + " --frames 5 -o " + out).exit_code, 0);
  EXPECT_EQ(read(out).frame_count(), 6u);

  io::SavedRun saved = io::read_state_file(state);
  if (!cuda_available()) {
    saved.device = "cuda";
    io::write_state_file(state, saved);
    expect_refused("-o " + out, 3, {state, "a run on a GPU, and there is none here"}, 6);
  }
  saved.version = "graupel 0.0.9";
  io::write_state_file(state, saved);
  const Outcome version = graupel("simulate --resume " + state);
  EXPECT_EQ(version.exit_code, 3);
  EXPECT_TRUE(version.says("was saved by graupel 0.0.9")) << version.output;
}

TEST_F(SavedRunErrors, DamagedStatesAndForeignTrajectories) {
  const std::string bytes = read_file(state);
  folder.write("a.state", bytes.substr(0, bytes.size() - 100));
  expect_refused("", 3, {state, "cut short"});
  std::string flipped = bytes;
  flipped[bytes.size() / 2] = static_cast<char>(flipped[bytes.size() / 2] ^ 4);
  folder.write("a.state", flipped);
  expect_refused("", 3, {state, "checksum"});
  EXPECT_EQ(graupel("inspect " + state).exit_code, 3);
  folder.write("a.state", bytes);
  const std::string foreign = folder.file("foreign.h5");
  ASSERT_EQ(graupel("simulate " + folder.write("small.json", small_scene()) + " --frames 3 -o " + foreign).exit_code,
            0);
  expect_refused("-o " + foreign, 3, {foreign, "cannot be continued", "other particles"});
  expect_refused("-o " + state, 2, {state, "would overwrite the state"});
}

TEST_F(SavedRunErrors, FlagsThatMakeNoSense) {
  const auto refused = [&](const std::string& flags, int exit_code, const std::string& word) {
    const Outcome outcome = graupel("simulate " + flags);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.output;
    EXPECT_TRUE(outcome.says(word)) << word << " is not in " << outcome.output;
  };
  refused(scene + " --save-every 5", 2, "Add --save-state FILE");
  refused(scene + " --save-every 0 --save-state b.state", 2, "1 or more");
  refused(scene + " --save-state " + folder.file("none/b.state"), 5, "there is no folder");
  refused(scene + " -o " + out + " --save-state " + out, 2, "name the same file");
  refused("--resume " + folder.file("none.state"), 3, "none.state");
  refused("--resume " + scene, 3, "it is no state of a run");
  refused(scene + " --fields stres", 2, "Did you mean 'stress'?");
  refused("", 2, "--resume with a saved state");
  refused(scene + " --device cpu --frames 1 -o " + folder.file("b.h5") + " --save-state /dev/full", 5,
          "no regular file");
}

TEST(RestartAfter, AStateThatWentElsewhereBeginsATrajectoryOfItsOwn) {
  const Folder folder;
  const std::string scene = folder.write("small.json", small_scene()), whole = folder.file("whole.h5"),
                    state = folder.file("a.state"), rest = folder.file("rest.h5");
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu -o " + whole).exit_code, 0);
  ASSERT_EQ(
      graupel("simulate " + scene + " --device cpu --frames 9 -o " + folder.file("a.h5") + " --save-state " + state)
          .exit_code,
      0);
  std::filesystem::remove(folder.file("a.h5"));
  const Outcome outcome = graupel("simulate --resume " + state + " --frames 12 -o " + rest);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("begins with frame 9")) << outcome.output;
  const Trajectory a = read(whole), b = read(rest);
  ASSERT_EQ(b.frame_count(), 4u);
  for (std::size_t f = 0; f < 4; ++f) {
    EXPECT_EQ(a.frames[9 + f].time, b.frames[f].time);
    EXPECT_TRUE(a.frames[9 + f].position == b.frames[f].position) << f;
  }
}

TEST(Fields, CountInTheDryRunAndShowInInspect) {
  const Folder folder;
  const std::string scene = folder.write("small.json", small_scene()), json = folder.file("dry.json");
  const auto disk = [&](const std::string& flags) {
    EXPECT_EQ(graupel("simulate " + scene + " --dry-run --device cpu --json " + json + flags).exit_code, 0);
    return nlohmann::json::parse(read_file(json))["disk_bytes"].get<double>();
  };
  EXPECT_EQ(disk(""), 885.0 * 13 * 24);
  EXPECT_EQ(disk(" --fields stress,plastic"), 885.0 * 13 * (24 + 28));
  const std::string out = folder.file("a.h5");
  ASSERT_EQ(graupel("simulate " + scene + " --frames 2 --fields plastic,stress -o " + out).exit_code, 0);
  EXPECT_TRUE(graupel("inspect " + out).says("fields: stress,plastic"));
  const Trajectory t = read(out);
  EXPECT_EQ(t.frames[0].fields[ParticleField::plastic], std::vector<float>(885, 1.0f));
  EXPECT_EQ(t.frames[2].fields[ParticleField::stress].size(), 6 * 885u);
  EXPECT_TRUE(t.frames[2].fields[ParticleField::affine].empty());
}

TEST(Fields, AreStoredInDataSets) {
  const Folder folder;
  const std::string flags =
      "generate scenes/recipes/hgn.json --set frames=2 --set counts.train=1 --set counts.valid=0 --set counts.test=0 "
      "--device cpu --seed 5 -o " +
      folder.file("data");
  ASSERT_EQ(graupel(flags + " --fields stress,deformation_gradient").exit_code, 0);
  const io::TrajectoryReader reader(folder.file("data/train.h5"));
  EXPECT_EQ(reader.fields(0), (FieldSet{ParticleField::stress, ParticleField::deformation_gradient}));
  // The same numbers as a single run of the stored scene.
  const Trajectory stored = reader.read(0, all_fields);
  const std::string scene = folder.write("scene.json", stored.scene_json), out = folder.file("single.h5");
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu --no-velocity --fields stress,deformation_gradient --seed " +
                    std::to_string(stored.seed) + " -o " + out)
                .exit_code,
            0);
  const Trajectory single = read(out);
  ASSERT_EQ(single.frame_count(), stored.frame_count());
  for (std::size_t f = 0; f < single.frame_count(); ++f) {
    EXPECT_TRUE(single.frames[f].position == stored.frames[f].position) << f;
    EXPECT_TRUE(single.frames[f].fields == stored.frames[f].fields) << f;
  }
  const Outcome other = graupel(flags);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_TRUE(other.says("other fields")) << other.output;
}

}  // namespace
}  // namespace graupel::test
