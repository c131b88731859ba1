// Saved states in files: all is read back, and what is foreign, cut or damaged is refused.
#include "io/trajectory/state_file.h"

#include <gtest/gtest.h>
#include <sys/mount.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

SavedRun sample_run() {
  SavedRun run;
  run.version = "graupel 1.2.3";
  run.device = "cpu";
  run.precision = "f64";
  run.seed = 0xfedcba9876543210u;
  run.frame = 41;
  run.time = 41 * (1.0 / 60);
  run.particles = 7;
  run.scene_json = "{\"name\": \"sample \xc3\xbc\"}";
  run.output = "/somewhere/a.h5";
  run.active = true;
  run.fields = {ParticleField::plastic};
  for (int f = 0; f < 3; ++f) {
    ParticleFrame frame = sample_frame(7, f);
    frame.active.assign(7, static_cast<uint8_t>(f));
    frame.fields[ParticleField::plastic].assign(7, 0.5f * static_cast<float>(f));
    run.recent.push_back(frame);
  }
  for (int i = 0; i < 1000; ++i) run.state.push_back(static_cast<std::byte>(i));
  return run;
}

TEST(StateFile, RoundTrips) {
  const TemporaryFolder folder;
  const SavedRun run = sample_run();
  write_state_file(folder.file("a.state"), run);
  EXPECT_TRUE(is_state_file(folder.file("a.state")));
  const SavedRun back = read_state_file(folder.file("a.state"));
  EXPECT_EQ(back.version, run.version);
  EXPECT_EQ(back.device, run.device);
  EXPECT_EQ(back.precision, run.precision);
  EXPECT_EQ(back.seed, run.seed);
  EXPECT_EQ(back.frame, run.frame);
  EXPECT_EQ(back.time, run.time);
  EXPECT_EQ(back.particles, run.particles);
  EXPECT_EQ(back.scene_json, run.scene_json);
  EXPECT_EQ(back.output, run.output);
  EXPECT_EQ(back.velocity, run.velocity);
  EXPECT_EQ(back.active, run.active);
  EXPECT_EQ(back.fields, run.fields);
  EXPECT_EQ(back.state, run.state);
  ASSERT_EQ(back.recent.size(), 3u);
  for (std::size_t f = 0; f < 3; ++f) {
    EXPECT_TRUE(same_frame(back.recent[f], run.recent[f]));
    EXPECT_EQ(back.recent[f].active, run.recent[f].active);
    EXPECT_EQ(back.recent[f].fields, run.recent[f].fields);
  }
  write_state_file(folder.file("b.state"), run);
  EXPECT_TRUE(bytes_of(folder.file("a.state")) == bytes_of(folder.file("b.state")));
}

TEST(StateFile, EveryTruncationAndEveryFlippedBitIsRefused) {
  const TemporaryFolder folder;
  write_state_file(folder.file("a.state"), sample_run());
  const std::string bytes = bytes_of(folder.file("a.state"));
  for (std::size_t n = 0; n < bytes.size(); n += 37)
    expect_error<InputError>([&] { read_state_file(folder.write("cut.state", bytes.substr(0, n))); },
                             {"cut.state", "Choose another state file"});
  expect_error<InputError>([&] { read_state_file(folder.write("long.state", bytes + "x")); }, {"it is too long"});
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string flipped = bytes;
    flipped[i] = static_cast<char>(flipped[i] ^ (1 << i % 8));
    expect_error<InputError>([&] { read_state_file(folder.write("flipped.state", flipped)); },
                             {"flipped.state", "Choose another state file"});
  }
}

TEST(StateFile, ForeignFilesAreRefused) {
  const TemporaryFolder folder;
  expect_error<InputError>([&] { read_state_file(folder.file("none.state")); }, {"none.state", "No such file"});
  expect_error<InputError>([&] { read_state_file(folder.path()); }, {"it is a folder"});
  const std::string text = folder.write("text.state", "a file of quite another kind, and long enough");
  expect_error<InputError>([&] { read_state_file(text); }, {"text.state", "it is no state of a run"});
  EXPECT_FALSE(is_state_file(text));
  EXPECT_FALSE(is_state_file(folder.write("short", "gra")));
  EXPECT_FALSE(is_state_file(folder.file("none.state")));
  write_state_file(folder.file("a.state"), sample_run());
  std::string newer = bytes_of(folder.file("a.state"));
  newer[14] = '2';
  expect_error<InputError>([&] { read_state_file(folder.write("newer.state", newer)); },
                           {"its format is 'graupel-state 2', this program reads 'graupel-state 1'"});
}

TEST(StateFile, AFullDiskKeepsTheStateThatWasThere) {
  const TemporaryFolder folder;
  const std::string disk = folder.file("disk");
  std::filesystem::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "cannot mount a small disk here";
  const std::string path = disk + "/a.state";
  SavedRun run = sample_run();
  write_state_file(path, run);
  run.state.resize(std::size_t(2) << 20);
  expect_error<IoError>([&] { write_state_file(path, run); }, {path, "No space left", "Free space"});
  EXPECT_EQ(read_state_file(path).state.size(), 1000u);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(disk), {}), 1);  // nothing is left behind
  umount2(disk.c_str(), MNT_DETACH);
}

}  // namespace
}  // namespace graupel::io
