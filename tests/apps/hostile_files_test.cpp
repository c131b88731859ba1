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

TEST(HostileFiles, PartFilesAreCheckedBeforeTheyAreRecovered) {
  const Folder folder;
  std::filesystem::rename(with_heap_size(folder, "crash.h5", uint64_t(1) << 32), folder.file("run.h5.part"));
  const Outcome outcome = graupel("inspect --recover " + folder.file("run.h5"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("run.h5.part") && outcome.says("crashed on it")) << outcome.output;
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
