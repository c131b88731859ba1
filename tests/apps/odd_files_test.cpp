// Files that are well-formed and of no use, files that are no files, and what is missing around the program.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/process/input_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/child.h"

namespace graupel::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

class OddFiles : public ::testing::Test {
 protected:
  /// A trajectory of one particle at these times; `change` may spoil a frame.
  std::string write_run(const std::string& name, const std::vector<double>& times,
                        const std::function<void(std::size_t, ParticleFrame&)>& change = {},
                        FieldSet fields = {}) const {
    Trajectory header;
    header.particle_type = {5};
    header.scene_json = small_scene();
    io::TrajectoryWriter writer(folder_.file(name), header, {.fields = fields});
    for (std::size_t k = 0; k < times.size(); ++k) {
      ParticleFrame frame;
      frame.time = times[k];
      frame.position = {{0.5f, 0.5f, 0.5f}};
      frame.velocity = {{0, 0, 0}};
      if (change) change(k, frame);
      writer.append(frame);
    }
    writer.finish();
    return folder_.file(name);
  }

  Folder folder_;
};

TEST_F(OddFiles, TimesThatDoNotAscend) {
  const double kept = 0.12345;  // writers take no other order, so the file is changed
  for (const double time : {0.05, std::nan("")}) {
    const std::string run = write_run("a.h5", {0, 0.1, kept});
    std::string bytes = read_file(run);
    const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(&kept), sizeof kept));
    ASSERT_NE(at, std::string::npos);
    std::memcpy(bytes.data() + at, &time, sizeof time);
    folder_.write("a.h5", bytes);
    for (const std::string& verb : {std::string("inspect "), "export -o " + folder_.file("e") + " "}) {
      const Outcome outcome = graupel(verb + run);
      EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
      EXPECT_TRUE(outcome.says("the time of frame ")) << outcome.output;
    }
  }
}

TEST_F(OddFiles, NumbersThatAreNoneAreNotExported) {
  const std::string place = write_run("x.h5", {0, 0.1}, [](std::size_t k, ParticleFrame& frame) {
    if (k == 1) frame.position[0][2] = nan;
  });
  const std::string speed = write_run("v.h5", {0, 0.1}, [](std::size_t k, ParticleFrame& frame) {
    if (k == 1) frame.velocity[0][0] = nan;
  });
  for (const char* format : {"vtp", "ply", "bgeo", "usda", "vdb"})
    for (const std::string& run : {place, speed}) {
      const Outcome outcome = graupel("export " + run + " -f " + format + " -o " + folder_.file(format));
      EXPECT_EQ(outcome.exit_code, 4) << format << "\n" << outcome.output;
      EXPECT_TRUE(outcome.says("frame 1") && outcome.says("not finite")) << outcome.output;
    }
  const Outcome outcome = graupel("validate " + place);
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("frame 1, particle 0: z = nan")) << outcome.output;
}

TEST_F(OddFiles, NumbersThatAreNoneAreFound) {
  const std::string speed = write_run("v.h5", {0, 0.1}, [](std::size_t k, ParticleFrame& frame) {
    if (k == 1) frame.velocity[0][1] = nan;
  });
  for (const std::string& verb : {"validate " + speed, "compare --models mpm --no-floors --scenes " + speed}) {
    const Outcome outcome = graupel(verb);
    EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
    EXPECT_TRUE(outcome.says("frame 1, particle 0: velocity y = nan m/s (allowed: finite)")) << outcome.output;
  }
  const std::string stress = write_run(
      "s.h5", {0, 0.1},
      [](std::size_t k, ParticleFrame& frame) { frame.fields[ParticleField::stress].assign(6, k == 1 ? nan : 0.0f); },
      {ParticleField::stress});
  const Outcome outcome = graupel("validate " + stress);
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("frame 1, particle 0: stress[0] = nan")) << outcome.output;
}

/// What dataset.json counts is there, and every frame of every split is read.
TEST_F(OddFiles, ADataSetIsAsWholeAsItsSplits) {
  std::filesystem::create_directory(folder_.file("set"));
  const auto validate = [&](const std::string& counts, int exit_code, const std::string& says) {
    folder_.write("set/dataset.json", counts);
    const Outcome outcome = graupel("validate " + folder_.file("set"));
    EXPECT_EQ(outcome.exit_code, exit_code) << counts << outcome.output;
    EXPECT_TRUE(outcome.says(says)) << says << "\n" << outcome.output;
  };
  const std::string counts = R"({"recipe": {"counts": {"train": 1, "valid": 0, "test": 1}}})";
  write_run("set/train.h5", {0, 1});
  validate(counts, 3, "set/test.h5' is not there, and dataset.json counts 1 trajectories");
  const std::string test = write_run("set/test.h5", {0, 1});
  validate(counts, 0, "set: ok");
  validate(R"({"recipe": {"parameters": [{"values": [1, 2, 3]}], "test": [0], "valid": []}})", 3,
           "set/train.h5' holds 1 trajectories (dataset.json counts 2)");
  validate(R"({"recipe": 3})", 0, "set: ok");
  validate("{", 3, "dataset.json' is damaged");
  write_run("set/test.h5", {0, 1}, [](std::size_t, ParticleFrame& frame) { frame.position[0][0] = nan; });
  validate(counts, 3, "set/test.h5': trajectory 0: frame 0, particle 0");
  for (const char* split : {"set/train.h5", "set/test.h5"}) std::filesystem::remove(folder_.file(split));
  validate("{}", 3, "has no split");
}

TEST_F(OddFiles, PlacesFarAwayAreNotExported) {
  const std::string far = write_run("x.h5", {0, 0.1}, [](std::size_t k, ParticleFrame& frame) {
    if (k == 1) frame.position[0][2] = -1e30f;
  });
  for (const char* format : {"vtp", "vdb"}) {
    const Outcome outcome = graupel("export " + far + " -f " + format + " -o " + folder_.file(format));
    EXPECT_EQ(outcome.exit_code, 4) << format << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("particle 0 of frame 1") && outcome.says("position is beyond 1e6 m")) << outcome.output;
  }
}

TEST_F(OddFiles, TrajectoriesWithoutFrames) {
  const std::string run = write_run("empty.h5", {});
  for (const std::string& verb : {"export -o " + folder_.file("e") + " ", std::string("view "),
                                  std::string("compare --models mpm --no-floors --scenes ")}) {
    const Outcome outcome = graupel(verb + run);
    EXPECT_EQ(outcome.exit_code, 3) << verb << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("empty.h5") && outcome.says(" frames")) << outcome.output;
  }
}

TEST_F(OddFiles, TrajectoriesThatAreTooShortToStartFrom) {
  const std::string rollout = "rollout models/hgn.safetensors ", start = " --start truth:6 -o " + folder_.file("b.h5");
  for (const std::vector<double>& times : {std::vector<double>{}, {0}, {0, 1, 2}, {0, 1, 2, 3, 4, 5}}) {
    const Outcome outcome = graupel(rollout + write_run("a.h5", times) + start);
    EXPECT_EQ(outcome.exit_code, 3) << times.size() << "\n" << outcome.output;
    EXPECT_TRUE(outcome.says("holds " + std::to_string(times.size()) + " frames") || outcome.says("holds no frames"))
        << outcome.output;
  }
}

TEST_F(OddFiles, WhatIsNoFile) {
  for (const char* file : {"/proc/self/mem", "/proc"})
    for (const std::string verb : {"simulate ", "rollout models/hgn.safetensors ", "validate "}) {
      const std::string link = folder_.file("link.json");
      std::filesystem::remove(link);
      std::filesystem::create_symlink(file, link);
      const Outcome outcome = graupel(verb + link);
      EXPECT_EQ(outcome.exit_code, 3) << verb << file << "\n" << outcome.output;
      EXPECT_TRUE(outcome.says("link.json")) << outcome.output;
      EXPECT_FALSE(outcome.says("basic_filebuf")) << outcome.output;
    }
}

TEST_F(OddFiles, NamesThatLeadNowhere) {
  const std::string loop = folder_.file("loop.json");
  std::filesystem::create_symlink(loop, loop);
  const std::pair<std::string, std::string> cases[] = {{loop, "(Too many levels of symbolic links)"},
                                                       {std::string(5000, 'a') + ".json", "(File name too long)"}};
  for (const auto& [name, says] : cases)
    for (const std::string verb : {"inspect ", "validate ", "compare --models mpm --scenes "}) {
      const Outcome outcome = graupel(verb + name);
      EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
      EXPECT_TRUE(outcome.says(says)) << outcome.output;
    }
}

/// It is not taken for damaged.
TEST_F(OddFiles, AFileThatMayNotBeRead) {
  const std::string run = write_run("a.h5", {0, 1});
  std::filesystem::permissions(folder_.file("."), std::filesystem::perms(0755));
  std::filesystem::permissions(run, std::filesystem::perms::none);
  const bool all_may = ::geteuid() == 0;
  ASSERT_EQ(::seteuid(all_may ? 65534 : ::geteuid()), 0);
  std::string said;
  try {
    experiments::check_readable(run);
  } catch (const InputError& error) {
    said = error.what();
  }
  try {
    const io::TrajectoryReader reader(run);
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), said);
  }
  ASSERT_EQ(::seteuid(all_may ? 0 : ::geteuid()), 0);
  EXPECT_NE(said.find("(Permission denied). Have its owner allow"), std::string::npos) << said;
}

TEST_F(OddFiles, APortInUse) {
  const std::string run = write_run("a.h5", {0, 1});
  const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  ASSERT_EQ(::bind(listener, any, size), 0);
  ASSERT_EQ(::listen(listener, 1), 0);
  ASSERT_EQ(::getsockname(listener, any, &size), 0);
  const std::string port = std::to_string(ntohs(address.sin_port));
  const Outcome outcome = graupel("view " + run + " --port " + port);
  ::close(listener);
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("port " + port + " cannot be used") && outcome.says("leave --port out")) << outcome.output;
}

TEST_F(OddFiles, AFolderThatCannotBeMade) {
  const std::string run = write_run("a.h5", {0, 1});
  for (const char* format : {"usda", "vtp"}) {
    const Outcome outcome = graupel("export " + run + " -f " + format + " -o " + run + "/folder");
    EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
    EXPECT_TRUE(outcome.says(run + "/folder") && outcome.says("Choose a folder")) << outcome.output;
  }
}

/// Libraries crash in their start-up where there is so little.
TEST_F(OddFiles, TooLittleAddressSpace) {
  const Outcome outcome =
      run_program("/bin/sh", "-c 'ulimit -v 150000; exec " GRAUPEL_BINARY_DIR "/graupel --version'");
  if (outcome.exit_code == 127) GTEST_SKIP() << "the system's loader needs more: " << outcome.output;
  EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
  EXPECT_TRUE(outcome.says("ulimit -v")) << outcome.output;
}

/// Stored runs whose frames are not those of their scene, by what reads them by number.
void expect_frames_refused(const std::string& arguments, const std::string& part) {
  const Outcome outcome = graupel(arguments);
  EXPECT_TRUE(outcome.exit_code == 2 || outcome.exit_code == 3) << arguments << ": " << outcome.output;
  EXPECT_TRUE(outcome.says(part)) << arguments << ": " << outcome.output;
}

TEST(StoredFrames, ThoseOfAStrideAreNotTheScenes) {
  const Folder folder;
  const std::string run = folder.file("strided.h5"), out = " -o " + folder.file("out.h5");
  const std::string model = "models/nsf-sand.safetensors", scene = " scenes/shared/sand_column.json";
  ASSERT_EQ(graupel("rollout " + model + scene + " --frames 24 --stride 4 -o " + run).exit_code, 0);
  const std::string part = "frames 0.06";
  expect_frames_refused("compare --no-floors --scenes " + run + " --models mpm," + model, part);
  expect_frames_refused("rollout models/hgn.safetensors " + run + " --frames 2" + out, part);
  expect_frames_refused("rollout models/hgn.safetensors " + run + " --start truth:6 --frames 1" + out, part);
  if (!training_is_built()) return;
  std::filesystem::create_directory(folder.file("data"));
  std::filesystem::rename(run, folder.file("data/train.h5"));
  expect_frames_refused("train hgn --data " + folder.file("data") + " --out " + folder.file("run"), part);
}

TEST(StoredFrames, ARunFromTheMiddleOfItsSceneIsNoTruthForMpm) {
  const Folder folder;
  const std::string whole = folder.file("whole.h5"), later = folder.file("later.h5");
  ASSERT_EQ(graupel("simulate scenes/shared/water_steps.json --frames 9 -o " + whole).exit_code, 0);
  ASSERT_EQ(graupel("rollout models/hgn.safetensors " + whole + " --start truth:6 --frames 2 -o " + later).exit_code,
            0);
  expect_frames_refused("compare --no-floors --scenes " + later + " --models mpm", "does not begin with its scene");
}

TEST(StoredFrames, ATruthOfAModelIsSaid) {
  const Folder folder;
  const std::string run = folder.file("run.h5"), model = "models/nsf-sand.safetensors";
  ASSERT_EQ(graupel("rollout " + model + " scenes/shared/sand_column.json --frames 4 -o " + run).exit_code, 0);
  const Outcome outcome = graupel("compare --no-floors --scenes " + run + " --models " + model);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("was made by 'models/nsf-sand.safetensors', not by MPM")) << outcome.output;
}

/// A load that is refused leaves no file behind.
TEST(StoredFrames, NoneAreBegunBeforeTheLoadsAreRead) {
  const Folder folder;
  const std::string run = folder.file("run.h5");
  expect_frames_refused("rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --load 1:2:3 -o " + run,
                        "--load");
  EXPECT_FALSE(std::filesystem::exists(run + ".part"));
}

}  // namespace
}  // namespace graupel::test
