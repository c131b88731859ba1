// Forces on obstacles and walls in trajectory files: stored exactly, recovered, continued.
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 30;
const TrajectoryWriteOptions with_forces{.contacts = {"obstacle_0", "wall_x_low", "wall_x_high"}, .flush_every = 4};

ParticleFrame frame_at(int64_t f) {
  ParticleFrame frame = sample_frame(particles, static_cast<int>(f));
  frame.time = 0.1 * static_cast<double>(f);
  return frame;
}

std::vector<ContactForce> forces_at(int64_t f) {
  std::vector<ContactForce> forces(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const double v = 0.1 * static_cast<double>(f) + static_cast<double>(i) / 3;
    forces[i] = {{v, -v, 0.5 * v}, {10 * v, 2, 3}, {v * v, 4, 5}, {0.1, 0.2, v}};
  }
  return forces;
}

void write_frames(TrajectoryWriter& writer, int64_t first, int64_t last) {
  for (int64_t f = first; f <= last; ++f) {
    writer.append(frame_at(f));
    writer.append_forces(forces_at(f));
  }
}

void expect_forces(const std::string& path, int64_t frames) {
  const TrajectoryReader reader(path);
  EXPECT_EQ(reader.contact_names(0), with_forces.contacts);
  const auto forces = reader.contact_forces(0);
  ASSERT_EQ(forces.size(), static_cast<std::size_t>(frames));
  for (int64_t f = 0; f < frames; ++f) EXPECT_TRUE(forces[static_cast<std::size_t>(f)] == forces_at(f)) << f;
  EXPECT_EQ(reader.header(0).frame_count(), static_cast<std::size_t>(frames));
}

TEST(StoredForces, ReadBackExactly) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), sample_header(particles), with_forces);
  write_frames(writer, 0, 20);
  writer.finish();
  expect_forces(folder.file("a.h5"), 21);
}

TEST(StoredForces, ThatAreNotFiniteAreRefused) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), sample_header(particles), with_forces);
  writer.append(frame_at(0));
  auto forces = forces_at(0);
  forces[1].torque[2] = std::numeric_limits<double>::quiet_NaN();
  writer.append_forces(forces);
  writer.finish();
  const TrajectoryReader reader(folder.file("a.h5"));
  expect_error<InputError>([&] { reader.contact_forces(0); },
                           {"'contact_torque' of 'wall_x_low' in frame 0 is not finite", "a.h5"});
}

TEST(StoredForces, AreNotInFilesThatDidNotAskForThem) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), sample_header(particles), {});
  writer.append(frame_at(0));
  writer.finish();
  const TrajectoryReader reader(folder.file("a.h5"));
  EXPECT_TRUE(reader.contact_names(0).empty());
  EXPECT_TRUE(reader.contact_forces(0).empty());
}

TEST(StoredForces, OfAnUnfinishedFileAreRecovered) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(particles), with_forces);
    write_frames(writer, 0, 13);
  }
  const int64_t usable = recover_part_file(path, true);
  ASSERT_GE(usable, 8);
  expect_forces(path, usable);
}

/// What the disk holds then is what a kill, or a disk that is full from then on, leaves.
TEST(StoredForces, AFlushedFrameHasThem) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), sample_header(particles), with_forces);
  write_frames(writer, 0, 7);
  std::filesystem::copy_file(folder.file("a.h5.part"), folder.file("b.h5.part"));
  ASSERT_EQ(recover_part_file(folder.file("b.h5"), true), 8);
  expect_forces(folder.file("b.h5"), 8);
  writer.finish();
}

TEST(StoredForces, GoOnWhereTheSavedStateIs) {
  const TemporaryFolder folder;
  for (const int64_t saved : {0, 3, 6, 8}) {
    const std::string path = folder.file("run" + std::to_string(saved) + ".h5");
    TrajectoryCheckpoint checkpoint;
    {
      TrajectoryWriter writer(path, sample_header(particles), with_forces);
      write_frames(writer, 0, saved);
      checkpoint = {saved, writer.checkpoint()};
      if (checkpoint.recent.empty()) checkpoint.recent = {frame_at(saved)};
      write_frames(writer, saved + 1, 9);
    }
    TrajectoryWriter writer(path, sample_header(particles), with_forces, checkpoint);
    write_frames(writer, saved + 1, 12);
    writer.finish();
    expect_forces(path, 13);
  }
}

TEST(StoredForces, AResumedRunHasTheBytesOfAnUninterruptedOne) {
  const TemporaryFolder folder;
  const auto run = [&](TrajectoryWriter& writer, int64_t first, int64_t state_every) {
    for (int64_t f = first; f <= 20; ++f) {
      write_frames(writer, f, f);
      if (f % state_every == 0) writer.checkpoint();
    }
    writer.finish();
  };
  const std::string whole = folder.file("whole.h5");
  {
    TrajectoryWriter writer(whole, sample_header(particles), with_forces);
    run(writer, 0, 1000);
  }
  for (const int64_t saved : {0, 3, 6, 12, 20})
    for (const bool complete : {false, true}) {
      const std::string path = folder.file("run.h5");
      TrajectoryCheckpoint checkpoint;
      {
        TrajectoryWriter writer(path, sample_header(particles), with_forces);
        write_frames(writer, 0, saved);
        checkpoint = {saved, writer.checkpoint()};
        if (checkpoint.recent.empty()) checkpoint.recent = {frame_at(saved)};
        if (complete) run(writer, saved + 1, 6);
      }
      TrajectoryWriter writer(path, sample_header(particles), with_forces, checkpoint);
      run(writer, saved + 1, 5);
      EXPECT_TRUE(read_file(path) == read_file(whole)) << saved << (complete ? ", complete" : "");
    }
}

TEST(StoredForces, AFileWithoutThemCannotGoOnWithThem) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  TrajectoryCheckpoint checkpoint;
  {
    TrajectoryWriter writer(path, sample_header(particles), {});
    writer.append(frame_at(0));
    checkpoint = {0, writer.checkpoint()};
  }
  expect_error<InputError>([&] { TrajectoryWriter(path, sample_header(particles), with_forces, checkpoint); },
                           {"stores position, velocity, and the run position, velocity, forces"});
}

TEST(StoredForces, MoreObstaclesThanAFileCanNameAreRefused) {
  const TemporaryFolder folder;
  TrajectoryWriteOptions options;
  options.contacts.resize(most_contacts, "obstacle_2047");
  TrajectoryWriter fits(folder.file("a.h5"), sample_header(particles), options);
  options.contacts.push_back("one more");
  expect_error<ConfigError>([&] { TrajectoryWriter(folder.file("b.h5"), sample_header(particles), options); },
                            {"2049", "2048"});
}

}  // namespace
}  // namespace graupel::io
