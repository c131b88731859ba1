// Trajectories of interrupted runs: continued to the bytes of an uninterrupted one, cut back, refused when foreign.
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 40;
const TrajectoryWriteOptions with_fields{
    .velocity = false, .active = true, .fields = {ParticleField::stress, ParticleField::plastic}, .flush_every = 4};

Trajectory header_of(const std::string& scene = "{\"gravity\":[0,-9.8,0],\"frames\":20}") {
  Trajectory header = sample_header(particles);
  header.scene_json = scene;
  return header;
}

/// As sample_frame, with times that count from 0.
ParticleFrame frame_at(int64_t f) {
  ParticleFrame frame = sample_frame(particles, static_cast<int>(f));
  frame.time = 0.1 * static_cast<double>(f);
  frame.active.assign(particles, static_cast<uint8_t>(f % 2));
  frame.fields[ParticleField::stress].assign(6 * particles, static_cast<float>(f));
  frame.fields[ParticleField::plastic].assign(particles, 0.5f * static_cast<float>(f));
  return frame;
}

/// A run of `frames` frames that ends without finish(); returns its checkpoint at `saved`.
TrajectoryCheckpoint interrupted_run(const std::string& path, int64_t frames, int64_t saved) {
  TrajectoryWriter writer(path, header_of(), with_fields);
  TrajectoryCheckpoint checkpoint;
  for (int64_t f = 0; f <= frames; ++f) {
    writer.append(frame_at(f));
    if (f == saved) checkpoint = {f, writer.checkpoint()};
  }
  if (checkpoint.recent.empty()) checkpoint.recent = {frame_at(saved)};
  return checkpoint;
}

void continue_run(const std::string& path, const TrajectoryCheckpoint& checkpoint, int64_t frames) {
  TrajectoryWriter writer(path, header_of(), with_fields, checkpoint);
  for (int64_t f = checkpoint.frame + 1; f <= frames; ++f) writer.append(frame_at(f));
  writer.finish();
}

void expect_whole(const std::string& path, int64_t frames) {
  const TrajectoryReader reader(path);
  EXPECT_TRUE(reader.complete());
  const Trajectory read = reader.read(0, with_fields.fields);
  ASSERT_EQ(read.frame_count(), static_cast<std::size_t>(frames + 1));
  for (int64_t f = 0; f <= frames; ++f) {
    const ParticleFrame &a = read.frames[static_cast<std::size_t>(f)], b = frame_at(f);
    ASSERT_EQ(a.time, b.time) << f;
    ASSERT_TRUE(a.position == b.position) << f;
    ASSERT_EQ(a.active, b.active) << f;
    ASSERT_TRUE(a.fields == b.fields) << f;
  }
  EXPECT_TRUE(reader.initial_velocity(0) == frame_at(0).velocity);
}

TEST(Continuation, GivesTheDataOfAnUninterruptedRun) {
  const TemporaryFolder folder;
  // frames until the end of the first run, frame of the saved state
  const int64_t cases[][2] = {{0, 0}, {5, 5}, {7, 7}, {9, 2}, {20, 3}, {14, 12}, {17, 16}};
  for (const auto& [frames, saved] : cases) {
    const std::string path = folder.file(std::to_string(frames) + ".h5");
    continue_run(path, interrupted_run(path, frames, saved), 20);
    expect_whole(path, 20);
    EXPECT_FALSE(std::filesystem::exists(path + ".part")) << frames << ", saved at " << saved;
  }
}

TEST(Continuation, AFinishedTrajectoryIsContinuedOrCutBack) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  continue_run(path, interrupted_run(path, 12, 12), 14);
  expect_whole(path, 14);
  // Killed before its first save: the finished file stays, and serves again where the other one lacks frames.
  { const TrajectoryWriter killed(path, header_of(), with_fields, {14, {frame_at(14)}}); }
  expect_whole(path, 14);
  EXPECT_TRUE(std::filesystem::exists(path + ".part"));
  continue_run(path, {14, {frame_at(14)}}, 20);
  expect_whole(path, 20);
  continue_run(path, {3, {frame_at(3)}}, 20);
  expect_whole(path, 20);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);  // nothing is left behind
}

TEST(Continuation, WithoutATrajectoryANewOneBeginsWithTheStatesFrame) {
  const TemporaryFolder folder;
  const std::string path = folder.file("rest.h5");
  continue_run(path, {5, {frame_at(4), frame_at(5)}}, 9);
  const Trajectory rest = TrajectoryReader(path).read(0);
  ASSERT_EQ(rest.frame_count(), 5u);
  EXPECT_EQ(rest.frames[0].time, 0.5);
  EXPECT_EQ(rest.frames[4].position, frame_at(9).position);
  continue_run(path, {7, {frame_at(7)}}, 11);  // and is continued itself
  const Trajectory more = TrajectoryReader(path).read(0);
  ASSERT_EQ(more.frame_count(), 7u);
  EXPECT_EQ(more.frames[6].position, frame_at(11).position);
  expect_error<InputError>([&] { continue_run(path, {2, {frame_at(2)}}, 11); }, {"it begins with frame 5"});
}

TEST(Continuation, MissingFramesAreNamed) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  interrupted_run(path, 5, 5);  // 4 frames are in the file
  const std::string before = bytes_of(path + ".part");
  expect_error<InputError>(
      [&] {
        continue_run(path, {9, {frame_at(8), frame_at(9)}}, 20);
      },
      {"a.h5.part", "frame 9", "it lacks frames 4-7"});
  expect_error<InputError>([&] { continue_run(path, {5, {frame_at(5)}}, 20); }, {"it lacks frame 4)"});
  EXPECT_TRUE(bytes_of(path + ".part") == before);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Continuation, TrajectoriesOfOtherRunsAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  const TrajectoryCheckpoint checkpoint = interrupted_run(path, 9, 9);
  const auto fails = [&](const Trajectory& header, const TrajectoryWriteOptions& options,
                         const TrajectoryCheckpoint& at, const std::string& part) {
    expect_error<InputError>([&] { TrajectoryWriter(path, header, options, at); }, {path, part, "Name the trajectory"});
  };
  fails(header_of("{\"gravity\":[0,0,0],\"frames\":20}"), with_fields, checkpoint, "it is of another scene");
  Trajectory header = header_of();
  header.seed += 1;
  fails(header, with_fields, checkpoint, "it has another seed");
  header = header_of();
  header.particle_type[0] = 6;
  fails(header, with_fields, checkpoint, "it has other particles");
  TrajectoryWriteOptions other = with_fields;
  other.fields = {ParticleField::stress};
  fails(header_of(), other, checkpoint,
        "it stores position, active, stress,plastic, and the run position, active, stress");
  TrajectoryCheckpoint moved{3, {frame_at(3)}};
  moved.recent[0].position[7][1] += 1e-6f;
  fails(header_of(), with_fields, moved, "its frame 3 is not that of the run");
  haddr_t address = 0;
  {
    const hdf5::Handle file = hdf5::open_file(path + ".part");
    const hid_t stress = H5Dopen2(file, "/00000/stress", H5P_DEFAULT);
    const hsize_t fourth_row[] = {4, 0, 0};
    unsigned mask = 0;
    hsize_t stored = 0;
    ASSERT_GE(H5Dget_chunk_info_by_coord(stress, fourth_row, &mask, &address, &stored), 0);
    H5Dclose(stress);
  }
  std::string damaged = bytes_of(path + ".part");
  damaged[address + 5] = static_cast<char>(damaged[address + 5] ^ 1);
  folder.write("a.h5.part", damaged);
  fails(header_of(), with_fields, checkpoint, "its frame 4 is damaged");
  folder.write("a.h5.part", "no HDF5");
  fails(header_of(), with_fields, checkpoint, "cannot open the file");
}

TEST(Continuation, MoreFramesOrAnotherNameAreTheSameScene) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  const TrajectoryCheckpoint checkpoint = interrupted_run(path, 9, 9);
  TrajectoryWriter writer(path, header_of("{\"name\":\"b\",\"gravity\":[0,-9.8,0],\"frames\":99}"), with_fields,
                          checkpoint);
  writer.append(frame_at(10));
  writer.finish();
  EXPECT_EQ(TrajectoryReader(path).read(0).frame_count(), 11u);
}

TEST(Continuation, ATrajectoryThatIsBeingWrittenIsLeftAlone) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  TrajectoryWriter busy(path, header_of(), with_fields);
  for (int64_t f = 0; f < 6; ++f) busy.append(frame_at(f));
  expect_error<IoError>([&] { continue_run(path, {3, {frame_at(3)}}, 9); }, {"another run"});
  busy.finish();
  EXPECT_EQ(TrajectoryReader(path).read(0).frame_count(), 6u);
}

TEST(Continuation, ForcesThatARecoveryLostAreNotMadeUp) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  TrajectoryWriteOptions options = with_fields;
  options.contacts = {"floor"};
  const std::vector<ContactForce> forces(1);
  TrajectoryCheckpoint checkpoint;
  {
    TrajectoryWriter writer(path, header_of(), options);
    for (int64_t f = 0; f <= 12; ++f) {
      writer.append(frame_at(f));
      writer.append_forces(forces);
    }
    checkpoint = {12, writer.checkpoint()};
  }
  ASSERT_LT(checkpoint.recent.size(), 13u);
  recover_part_file(path, true);
  expect_error<InputError>([&] { TrajectoryWriter(path, header_of(), options, checkpoint); }, {"forces of row"});
}

TEST(Writer, FramesThatWereLeftAreAllRecovered) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, header_of(), with_fields);
    for (int64_t f = 0; f <= 6; ++f) writer.append(frame_at(f));
    writer.leave();
  }
  EXPECT_EQ(recover_part_file(path, false), 7);
}

TEST(Writer, TakesFramesInTheirOrder) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), header_of(), with_fields);
  writer.append(frame_at(3));
  for (const int64_t f : {2, 3})
    expect_error<ConfigError>([&] { writer.append(frame_at(f)); }, {"frame 1 of", "0.300000 s", "in their order"});
  writer.append(frame_at(4));
  writer.finish();
}

}  // namespace
}  // namespace graupel::io
