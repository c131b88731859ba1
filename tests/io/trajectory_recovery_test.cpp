#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "file_size_limit.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 300;

/// A child process writes `frames` frames and is killed without a chance to clean up.
void write_and_kill(const std::string& path, int frames, int flush_every) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    TrajectoryWriter writer(path, sample_header(particles), {.flush_every = flush_every});
    writer.attribute("note", "before the kill");
    writer.parameters({{"speed", "m/s", 1.5}});
    for (int k = 0; k < frames; ++k) writer.append(sample_frame(particles, k));
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

TEST(Recovery, FindsEveryFlushedFrameAfterAKill) {
  TemporaryFolder folder;
  // frames appended, flush interval, frames flushed by then (chunks of at most 8 frames)
  const int cases[][3] = {{7, 2, 6}, {9, 1, 9}, {30, 8, 24}, {50, 20, 48}, {3, 8, 0}};
  for (const auto& [frames, flush_every, flushed] : cases) {
    const std::string path = folder.file("a" + std::to_string(frames) + ".h5");
    write_and_kill(path, frames, flush_every);
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_EQ(recover_part_file(path, false), flushed);
    EXPECT_EQ(recover_part_file(path, true), flushed);
    EXPECT_EQ(std::filesystem::exists(path), flushed > 0);
    if (flushed == 0) continue;
    EXPECT_FALSE(std::filesystem::exists(path + ".part"));
    const TrajectoryReader reader(path);
    EXPECT_TRUE(reader.complete());
    const Trajectory read = reader.read(0);
    EXPECT_EQ(read.seed, sample_header(1).seed);
    EXPECT_EQ(read.scene_json, sample_header(1).scene_json);
    EXPECT_EQ(reader.attribute(0, "note"), "before the kill");
    EXPECT_EQ(reader.attribute(0, "recovered"), "1");
    EXPECT_EQ(reader.parameters(0), (std::vector<NamedValue>{{"speed", "m/s", 1.5}}));
    ASSERT_EQ(read.frame_count(), static_cast<std::size_t>(flushed));
    for (int k = 0; k < flushed; ++k) ASSERT_TRUE(same_frame(read.frames[k], sample_frame(particles, k))) << k;
  }
}

TEST(Recovery, StopsAtADamagedChunk) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(particles), {.velocity = false, .flush_every = 4});
    for (int k = 0; k < 12; ++k) writer.append(sample_frame(particles, k));
  }
  ASSERT_EQ(recover_part_file(path, false), 12);
  std::string bytes = bytes_of(path + ".part");
  // Chunks lie one after another in the order they were written; the last bytes of the file belong to the third.
  bytes[bytes.size() - 400] = static_cast<char>(bytes[bytes.size() - 400] ^ 1);
  folder.write("a.h5.part", bytes);
  EXPECT_EQ(recover_part_file(path, true), 8);
  EXPECT_TRUE(same_frame(TrajectoryReader(path).frames(0, 7, 1)[0], [] {
    ParticleFrame frame = sample_frame(particles, 7);
    frame.velocity.clear();
    return frame;
  }()));
}

TEST(Recovery, ADestructorWithoutFinishLeavesTheFlushedFrames) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(3), {.flush_every = 1});
    for (int k = 0; k < 4; ++k) writer.append(sample_frame(3, k));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_EQ(recover_part_file(path, false), 4);
  EXPECT_FALSE(TrajectoryReader(path + ".part").complete());
}

TEST(Recovery, KeepsWhichParticlesAreInTheRun) {
  TemporaryFolder folder;
  const std::string path = folder.file("active.h5");
  {
    TrajectoryWriteOptions options;
    options.active = true;
    TrajectoryWriter writer(path, sample_header(4), options);
    for (int k = 0; k < 20; ++k) {
      ParticleFrame frame = sample_frame(4, k);
      frame.active = {1, 1, 0, static_cast<uint8_t>(k % 2)};
      writer.append(frame);
    }
  }
  EXPECT_EQ(recover_part_file(path, true), 16);
  const Trajectory back = TrajectoryReader(path).read(0);
  EXPECT_EQ(back.frames[15].active, (std::vector<uint8_t>{1, 1, 0, 1}));
}

TEST(Recovery, NothingUsableIsZeroAndNoFileIsAnError) {
  TemporaryFolder folder;
  folder.write("a.h5.part", "");
  EXPECT_EQ(recover_part_file(folder.file("a.h5"), true), 0);
  expect_error<InputError>([&] { recover_part_file(folder.file("b.h5"), false); }, {"b.h5.part", "to recover"});
}

TEST(Recovery, NamesWhatIsWrongWithADamagedFile) {
  TemporaryFolder folder;
  folder.write("a.h5.part", "not a trajectory, but not empty");
  expect_error<InputError>([&] { recover_part_file(folder.file("a.h5"), true); }, {"a.h5.part", "damaged"});
  EXPECT_TRUE(std::filesystem::exists(folder.file("a.h5.part")));
}

TEST(Recovery, AFileThatIsStillWrittenIsLeftAlone) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  TrajectoryWriter writer(path, sample_header(3), {.flush_every = 1});
  for (int k = 0; k < 4; ++k) writer.append(sample_frame(3, k));
  expect_error<InputError>([&] { recover_part_file(path, true); }, {"a.h5.part", "still being written"});
  writer.finish();
  EXPECT_EQ(TrajectoryReader(path).read(0).frame_count(), 4u);
  EXPECT_EQ(TrajectoryReader(path).attribute(0, "recovered"), "");
}

/// The child of a fork, as when another thread starts a program, has the file's descriptor until its exec.
TEST(Writer, FinishesWhileAChildWasJustForked) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  TrajectoryWriter writer(path, sample_header(3), {});
  writer.append(sample_frame(3, 0));
  const pid_t child = fork();
  if (child == 0)
    for (;;) pause();
  EXPECT_NO_THROW(writer.finish());
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(Writer, ASecondOneOfTheSameFileIsRefusedAndTheFirstGoesOn) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5"), other = folder.file("b.h5");
  {
    TrajectoryWriter finished(other, sample_header(3));
    finished.append(sample_frame(3, 0));
    finished.finish();
  }
  TrajectoryWriter writer(path, sample_header(3), {.flush_every = 1});
  for (int k = 0; k < 4; ++k) writer.append(sample_frame(3, k));
  expect_error<IoError>([&] { TrajectoryWriter(path, sample_header(3)); }, {"another run", "a.h5.part"});
  expect_error<IoError>([&] { merge_trajectories({other}, path); }, {"another run", "a.h5.part"});
  for (int k = 4; k < 9; ++k) writer.append(sample_frame(3, k));
  writer.finish();
  const Trajectory read = TrajectoryReader(path).read(0);
  ASSERT_EQ(read.frame_count(), 9u);
  for (int k = 0; k < 9; ++k) EXPECT_TRUE(same_frame(read.frames[k], sample_frame(3, k))) << k;
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);  // nothing is left beside them
}

TEST(Writer, TakesThePlaceOfWhatADeadRunLeft) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  write_and_kill(path, 9, 1);
  TrajectoryWriter writer(path, sample_header(3));
  writer.append(sample_frame(3, 0));
  writer.finish();
  EXPECT_EQ(TrajectoryReader(path).read(0).particle_count(), 3u);
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
}

TEST(Merge, KeepsTrajectoriesInOrder) {
  TemporaryFolder folder;
  std::vector<std::string> parts;
  for (int i = 0; i < 3; ++i) {
    parts.push_back(folder.file("p" + std::to_string(i) + ".h5"));
    TrajectoryWriter writer(parts.back(), sample_header(10 + i));
    for (int k = 0; k < 4; ++k) writer.append(sample_frame(10 + i, k + i));
    writer.finish(i);
  }
  merge_trajectories(parts, folder.file("train.h5"));
  const TrajectoryReader reader(folder.file("train.h5"));
  EXPECT_TRUE(reader.complete());
  ASSERT_EQ(reader.count(), 3);
  for (const int i : {2, 0, 1}) {
    const Trajectory read = reader.read(i);
    EXPECT_EQ(read.particle_count(), 10u + i);
    EXPECT_EQ(read.diverged_at_frame, i);
    EXPECT_EQ(read.scene_json, sample_header(1).scene_json);
    for (int k = 0; k < 4; ++k) EXPECT_TRUE(same_frame(read.frames[k], sample_frame(10 + i, k + i)));
  }
}

TEST(Merge, ADiskThatIsFullAtAnyByteIsAnErrorThatLeavesNothing) {
  TemporaryFolder folder;
  std::vector<std::string> parts;
  for (int i = 0; i < 3; ++i) {
    parts.push_back(folder.file("p" + std::to_string(i) + ".h5"));
    TrajectoryWriter writer(parts.back(), sample_header(200));
    for (int k = 0; k < 20; ++k) writer.append(sample_frame(200, k));
    writer.finish();
  }
  const std::string merged = folder.file("train.h5");
  merge_trajectories(parts, merged);
  const auto size = std::filesystem::file_size(merged);
  std::filesystem::remove(merged);
  for (rlim_t limit = 1; limit < size; limit += size / 61) {
    const FileSizeLimit disk(limit);
    expect_error<IoError>([&] { merge_trajectories(parts, merged); }, {merged, "File too large", "Free space"});
    EXPECT_FALSE(std::filesystem::exists(merged)) << limit;
    EXPECT_FALSE(std::filesystem::exists(merged + ".part")) << limit;
  }
  merge_trajectories(parts, merged);  // the library is whole
  EXPECT_EQ(std::filesystem::file_size(merged), size);
}

TEST(Writer, AFullDiskLeavesWhatWasFlushedOrNothing) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  const auto write = [&] {
    TrajectoryWriter writer(path, sample_header(200), {.flush_every = 4});
    for (int k = 0; k < 20; ++k) writer.append(sample_frame(200, k));
    writer.finish();
  };
  write();
  const auto size = std::filesystem::file_size(path);
  std::filesystem::remove(path);
  int64_t kept = 0;
  for (rlim_t limit = 1; limit < size; limit += size / 61) {
    {
      const FileSizeLimit disk(limit);
      expect_error<IoError>(write, {path + ".part", "File too large"});
    }
    EXPECT_FALSE(std::filesystem::exists(path)) << limit;
    if (!std::filesystem::exists(path + ".part")) continue;  // it could not be started
    const int64_t frames = recover_part_file(path, false);
    EXPECT_GE(frames, kept) << limit;
    kept = frames;
  }
  EXPECT_GE(kept, 12);
}

TEST(Merge, RefusesUnfinishedAndMergedFiles) {
  TemporaryFolder folder;
  {
    TrajectoryWriter writer(folder.file("a.h5"), sample_header(3), {.flush_every = 1});
    writer.append(sample_frame(3, 0));
  }
  expect_error<InputError>([&] { merge_trajectories({folder.file("a.h5.part")}, folder.file("m.h5")); },
                           {"a.h5.part", "not complete"});
  recover_part_file(folder.file("a.h5"), true);
  merge_trajectories({folder.file("a.h5"), folder.file("a.h5")}, folder.file("two.h5"));
  expect_error<InputError>([&] { merge_trajectories({folder.file("two.h5")}, folder.file("m.h5")); },
                           {"two.h5", "has 2 trajectories"});
  expect_error<InputError>([&] { merge_trajectories({}, folder.file("m.h5")); }, {"no trajectories"});
  EXPECT_FALSE(std::filesystem::exists(folder.file("m.h5")));
}

}  // namespace
}  // namespace graupel::io
