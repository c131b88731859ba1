// Files that lack values, which HDF5 would read as zeros, and part files whose end a power failure took.
#include <gtest/gtest.h>

#include <cstring>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/hdf5/superblock.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 300;
constexpr int frames = 6, flush_every = 2;

/// Leaves `path`.part without finish(), or `path` with it.
void write(const std::string& path, bool finish, int count = frames, int deflate = 1) {
  TrajectoryWriter writer(path, sample_header(particles), {.deflate = deflate, .flush_every = flush_every});
  for (int k = 0; k < count; ++k) writer.append(sample_frame(particles, k));
  if (finish) writer.finish();
}

/// The same file whose indices of chunks (B-trees, version 1) have the last row of chunks behind the last frame.
std::string with_moved_chunks(std::string bytes) {
  const auto key = [](uint64_t row) {  // mask of filters, offsets along three dimensions and in the element
    std::string text(36, '\0');
    text[4] = static_cast<char>(row);
    return text;
  };
  int moved = 0;
  for (std::size_t tree = bytes.find("TREE\x01"); tree != std::string::npos; tree = bytes.find("TREE\x01", tree + 1)) {
    const std::size_t at = bytes.find(key(frames - flush_every), tree);
    if (at == std::string::npos || at > tree + 1000) continue;
    bytes.replace(at, key(0).size(), key(frames + flush_every));
    ++moved;
  }
  EXPECT_GE(moved, 2);  // positions and velocities
  return bytes;
}

TEST(DamagedFile, AChunkAtAnotherPlaceIsMissing) {
  TemporaryFolder folder;
  write(folder.file("good.h5"), true);
  const std::string moved = folder.write("moved.h5", with_moved_chunks(bytes_of(folder.file("good.h5"))));
  const TrajectoryReader reader(moved);
  EXPECT_EQ(reader.frames(0, 0, 4).size(), 4u);
  for (const int64_t first : {4, 5})
    expect_error<InputError>([&] { reader.frames(0, first, 1); }, {"moved.h5", "a chunk is missing"});
  expect_error<InputError>([&] { reader.positions(0, 0, frames); }, {"moved.h5", "a chunk is missing"});
  expect_error<InputError>([&] { reader.velocities(0, 0, frames); }, {"moved.h5", "a chunk is missing"});
}

/// A data set with everything but the values of `lacking`.
std::string file_without(const TemporaryFolder& folder, const std::string& lacking) {
  const std::string path = folder.file(lacking + ".h5");
  const hdf5::Handle file = hdf5::create_file(path);
  const hdf5::Handle group = hdf5::create_group(file, "00000");
  const std::vector<float> x(24, 1.0f);
  const std::vector<double> time = {0, 1};
  const std::vector<int32_t> types(4, 5);
  const std::vector<uint8_t> active(8, 1);
  const auto add = [&](const std::string& name, std::vector<hsize_t> size, hdf5::Element element, const void* values) {
    const bool in_frames = name != "particle_type" && name != "initial_velocity";
    std::vector<hsize_t> chunk = in_frames ? size : std::vector<hsize_t>();
    if (in_frames) chunk[0] = 1;
    const hdf5::Handle dataset = hdf5::create_dataset(group, name, {.element = element, .size = size, .chunk = chunk});
    if (name != lacking) hdf5::write_all(dataset, element, values);
  };
  add("position", {2, 4, 3}, hdf5::Element::float32, x.data());
  add("velocity", {2, 4, 3}, hdf5::Element::float32, x.data());
  add("stress", {2, 4, 6}, hdf5::Element::float32, std::vector<float>(48, 1.0f).data());
  add("active", {2, 4}, hdf5::Element::uint8, active.data());
  add("time", {2}, hdf5::Element::float64, time.data());
  add("particle_type", {4}, hdf5::Element::int32, types.data());
  add("initial_velocity", {4, 3}, hdf5::Element::float32, x.data());
  return path;
}

TEST(DamagedFile, DatasetsWithoutValuesAreNotReadAsZeros) {
  TemporaryFolder folder;
  const auto read = [](const std::string& path) {
    const TrajectoryReader reader(path);
    reader.read(0);
    reader.initial_velocity(0);
  };
  EXPECT_NO_THROW(read(file_without(folder, "nothing")));
  for (const char* name : {"position", "velocity", "stress", "active", "time", "particle_type", "initial_velocity"})
    expect_error<InputError>([&] { read(file_without(folder, name)); },
                             {std::string(name) + ".h5", "chunks of '" + std::string(name) + "' are missing"});
}

TEST(DamagedFile, APartFileThatLostItsEndIsRecovered) {
  TemporaryFolder folder;
  for (const int deflate : {0, 1}) {
    const std::string whole = folder.file("whole" + std::to_string(deflate) + ".h5");
    write(whole, false, 30, deflate);
    const std::string bytes = bytes_of(whole + ".part");
    ASSERT_EQ(hdf5::stated_end(whole + ".part"), bytes.size());
    int64_t least = 30;
    int recovered = 0;
    for (const double kept : {0.999, 0.9, 0.7, 0.5, 0.3}) {
      const std::string path = folder.file("cut.h5");
      const std::string part = folder.write(
          "cut.h5.part", bytes.substr(0, static_cast<std::size_t>(kept * static_cast<double>(bytes.size()))));
      expect_error<InputError>([&] { TrajectoryReader reader(part); }, {"cut.h5.part", "truncated file"});
      int64_t count = 0;
      try {
        count = recover_part_file(path, false);
        EXPECT_EQ(recover_part_file(path, true), count);
      } catch (const InputError&) {
        EXPECT_LT(kept, 0.9);  // the list of chunks was in the lost part
        continue;
      }
      EXPECT_LE(count, least) << kept;
      least = count;
      EXPECT_FALSE(std::filesystem::exists(part + ".cut"));
      if (count == 0) continue;
      ++recovered;
      const Trajectory read = TrajectoryReader(path).read(0);
      ASSERT_EQ(read.frame_count(), static_cast<std::size_t>(count));
      for (int64_t k = 0; k < count; ++k)
        ASSERT_TRUE(same_frame(read.frames[static_cast<std::size_t>(k)], sample_frame(particles, static_cast<int>(k))));
    }
    EXPECT_GE(recovered, 2);
  }
}

TEST(DamagedFile, TheStatedEndIsReadAndChanged) {
  TemporaryFolder folder;
  EXPECT_FALSE(hdf5::stated_end(folder.file("missing.h5")));
  EXPECT_FALSE(hdf5::stated_end(folder.write("text.h5", std::string(100, 'x'))));
  write(folder.file("a.h5"), true);
  const std::string before = bytes_of(folder.file("a.h5"));
  EXPECT_EQ(hdf5::stated_end(folder.file("a.h5")), before.size());
  hdf5::state_end(folder.file("a.h5"), 0x123456789abcdef0u);
  EXPECT_EQ(hdf5::stated_end(folder.file("a.h5")), 0x123456789abcdef0u);
  EXPECT_EQ(bytes_of(folder.file("a.h5")).substr(48), before.substr(48));
}

}  // namespace
}  // namespace graupel::io
