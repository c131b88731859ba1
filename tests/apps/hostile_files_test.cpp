// Files made to do harm: what the libraries of their formats cannot survive is an error that names the file.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>

#include "core/system/stopwatch.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

std::string bytes_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A small trajectory.
std::string good_file(const Folder& folder) {
  Trajectory header;
  header.particle_type.assign(40, 5);
  header.frame_time = 0.1;
  header.scene_json = "{}";
  header.made_by = "mpm";
  io::TrajectoryWriter writer(folder.file("good.h5"), header, {.flush_every = 2});
  for (int k = 0; k < 6; ++k) {
    ParticleFrame frame;
    frame.time = 0.1 * k;
    frame.position.assign(40, Vec3f{0.5f, 0.1f * static_cast<float>(k), 0.5f});
    frame.velocity.assign(40, Vec3f{0, 0, 0});
    writer.append(frame);
  }
  writer.finish();
  return folder.file("good.h5");
}

/// The file with another size of the first object of its global heap, which holds the texts of attributes.
std::string with_heap_size(const Folder& folder, const std::string& name, uint64_t size) {
  std::string bytes = bytes_of(good_file(folder));
  const std::size_t heap = bytes.find("GCOL");
  std::memcpy(bytes.data() + heap + 24, &size, sizeof size);
  return folder.write(name, bytes);
}

TEST(HostileFiles, ACrashOfTheHdf5LibraryIsAnErrorThatNamesTheFile) {
  const Folder folder;
  const std::string file = with_heap_size(folder, "crash.h5", uint64_t(1) << 32);
  const std::string to = folder.file("out");
  for (const std::string& line : {"inspect " + file, "export " + file + " -o " + to,
                                  "rollout models/hgn.safetensors " + file + " --start truth:6 -o " + to}) {
    const Outcome outcome = graupel(line);
    EXPECT_EQ(outcome.exit_code, 3) << line << ": " << outcome.output;
    for (const char* part : {"crash.h5", "the HDF5 library crashed on it", "make it again or choose another"})
      EXPECT_TRUE(outcome.says(part)) << part << " is not in: " << outcome.output;
  }
}

TEST(HostileFiles, AnEndlessLoopOfTheHdf5LibraryIsAnErrorToo) {
  const Folder folder;
  const Stopwatch watch;
  const Outcome outcome = graupel("inspect " + with_heap_size(folder, "loop.h5", ~uint64_t(15)));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("loop.h5") && outcome.says("does not come to an end with it")) << outcome.output;
  EXPECT_LT(watch.seconds(), 60);
}

TEST(HostileFiles, ItIsTheHeapThatMatters) {
  const Folder folder;
  EXPECT_EQ(graupel("inspect " + good_file(folder)).exit_code, 0);
}

TEST(HostileFiles, AFilterThatIsLongerThanItsMessageIsNoLackOfMemory) {
  const Folder folder;
  std::string bytes = bytes_of(good_file(folder));
  const std::size_t filter = bytes.find("deflate");
  ASSERT_NE(filter, std::string::npos);
  const uint16_t values = 0x7fff;  // the number of them is before its name
  std::memcpy(bytes.data() + filter - 2, &values, sizeof values);
  const Outcome outcome = graupel("inspect " + folder.write("filter.h5", bytes));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("filter.h5") && !outcome.says("out of memory")) << outcome.output;
}

TEST(HostileFiles, PartFilesAreCheckedBeforeTheyAreRecovered) {
  const Folder folder;
  std::filesystem::rename(with_heap_size(folder, "crash.h5", uint64_t(1) << 32), folder.file("run.h5.part"));
  const Outcome outcome = graupel("inspect --recover " + folder.file("run.h5"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("run.h5.part") && outcome.says("crashed on it")) << outcome.output;
}

/// An obstacle's level set.
std::string good_vdb(const Folder& folder) {
  const std::string scene =
      folder.write("scene.json", small_scene("  \"obstacle_voxel\": 0.02, \"obstacles\": [{ \"shape\": \"sphere\", "
                                             "\"radius\": 0.1, \"position\": [0.2, 0.2, 0.2] }]"));
  EXPECT_EQ(graupel("simulate " + scene + " --frames 0 -o " + folder.file("a.h5") + " --write-obstacles " +
                    folder.file("good.vdb"))
                .exit_code,
            0);
  return folder.file("good.vdb");
}

/// Refused by the checker in limited time, in inspections and as an obstacle.
void expect_no_vdb(const Folder& folder, const std::string& bytes) {
  folder.write("bad.vdb", bytes);
  const std::string scene =
      folder.write("bad.json", small_scene("  \"obstacles\": [{ \"shape\": \"vdb\", \"file\": \"bad.vdb\" }]"));
  for (const std::string& line : {"inspect " + folder.file("bad.vdb"), "simulate --dry-run " + scene}) {
    const Stopwatch watch;
    const Outcome outcome = graupel(line);
    EXPECT_EQ(outcome.exit_code, 3) << line << ": " << outcome.output;
    EXPECT_TRUE(outcome.says("bad.vdb") && outcome.says("the OpenVDB library ") &&
                (outcome.says("MiB of memory for it") || outcome.says("does not come to an end with it") ||
                 outcome.says("finds its end in the middle of a grid") ||
                 outcome.says("writes or reads beyond its memory with it")))
        << outcome.output;
    EXPECT_LT(watch.seconds(), 120);
  }
}

template <typename T>
std::string with(std::string bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

/// Of the first grid in the file: its name, its type and that of its parent, each after its length, then where its
/// data begin, where its values do and where it ends.
std::size_t begin_of_places(const std::string& vdb) {
  const std::string type = "Tree_float_5_4_3";
  return vdb.find(type) + type.size() + 4;
}

TEST(HostileFiles, TextsOfGigabytesInAVdbFileAreNotRead) {
  const Folder folder;
  const std::string good = bytes_of(good_vdb(folder));
  EXPECT_EQ(graupel("inspect " + folder.file("good.vdb")).exit_code, 0);
  const auto before = [&](const std::string& text) { return good.find(text) - 4; };
  for (const std::size_t at : {before("obstacle_0_sphere"), before("Tree_float"), before("class"), before("level set")})
    expect_no_vdb(folder, with(good, at, uint32_t(0x7fffffff)));
}

TEST(HostileFiles, GridsOfAVdbFileAreCheckedWhereTheProgramReadsThem) {
  const Folder folder;
  const std::string good = bytes_of(good_vdb(folder));
  const std::size_t places = begin_of_places(good);
  // Metadata there, after the kind of compression: one text, 'a', of two gigabytes.
  const std::string metadata("\6\0\0\0\1\0\0\0\1\0\0\0a\6\0\0\0string\xff\xff\xff\x7f", 27);
  expect_no_vdb(folder, with(good + metadata, places, uint64_t(good.size())));
  // The first grid ends nowhere: what the program reads of the second is what its variables hold.
  for (const uint64_t end : {~uint64_t(0), uint64_t(1) << 40}) expect_no_vdb(folder, with(good, places + 16, end));
  // A second grid there whose name has two gigabytes.
  expect_no_vdb(folder, with(good + std::string("\xff\xff\xff\x7f", 4), places + 16, uint64_t(good.size())));
}

TEST(HostileFiles, ArraysOfAVdbFileThatAreLongerThanTheirMemoryAreNotRead) {
  const Folder folder;
  const std::string good = bytes_of(good_vdb(folder)), map = "UniformScaleMap";
  // The grid's kind of compression; the length of the first block's values, after a map of 120 bytes, the tree's five
  // numbers and the block's place, masks and kind of inactive values.
  const std::size_t compression = begin_of_places(good) + 24;
  const std::size_t length = good.find(map) + map.size() + 120 + 4 * 4 + 12 + 2 * 4096 + 1;
  for (const uint32_t kind : {3, 6}) {  // zip, Blosc
    const std::string packed = with(with(good, length - 1, uint8_t(0)), compression, kind);
    expect_no_vdb(folder, with(packed, length, int64_t(-40000)));
  }
  // Blosc: 16 bytes, of which it is said that they are 100,000, to be expanded to none.
  std::string blosc = with(with(with(good, length - 1, uint8_t(0)), compression, uint32_t(6)), length, int64_t(16));
  const uint8_t header[16] = {2, 1, 0x21, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0xa0, 0x86, 1, 0};
  std::memcpy(blosc.data() + length + 8, header, sizeof header);
  expect_no_vdb(folder, blosc);
}

TEST(HostileFiles, WhatOneCheckerCannotTellIsRefusedWithoutTheOther) {
  const Folder folder;
  const std::string good = bytes_of(good_vdb(folder)), checker = "graupel-check-vdb";
  folder.write("longer.vdb", good + '\0');
  std::filesystem::copy(std::string(GRAUPEL_BINARY_DIR "/") + checker, folder.file(checker));
  const auto inspect = [&](const std::string& name) {
    return run_program("/usr/bin/env", "GRAUPEL_CHECKERS=" + folder.file("") +
                                           " " GRAUPEL_BINARY_DIR "/graupel inspect " + folder.file(name));
  };
  EXPECT_EQ(inspect("good.vdb").exit_code, 0);
  EXPECT_EQ(inspect("longer.vdb").exit_code, 3);
  std::filesystem::copy(std::string(GRAUPEL_BINARY_DIR "/") + checker + "-library", folder.file(checker + "-library"));
  EXPECT_EQ(inspect("longer.vdb").exit_code, 0);
}

TEST(HostileFiles, APipeIsNoTrajectory) {
  const Folder folder;
  const std::string pipe = folder.file("pipe.h5");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Outcome outcome = graupel("export " + pipe + " -o " + folder.file("out"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("pipe.h5")) << outcome.output;
}

}  // namespace
}  // namespace graupel::test
