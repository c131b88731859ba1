#include "core/system/atomic_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "core/system/error.h"

namespace graupel {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("graupel_atomic_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(AtomicFileTest, WritesReplacesAndLeavesNoPart) {
  const std::string path = folder_ / "a.txt";
  write_file_atomically(path, "one");
  write_file_atomically(path, "second");
  EXPECT_EQ(read_file(path), "second");
  EXPECT_EQ(names_in(folder_), std::vector<std::string>{"a.txt"});
}

TEST_F(AtomicFileTest, WritersOfOnePathDoNotDisturbEachOther) {
  const std::string path = folder_ / "a.txt";
  std::vector<std::thread> writers;
  for (int w = 0; w < 4; ++w)
    writers.emplace_back([&, w] {
      for (int i = 0; i < 50; ++i) write_file_atomically(path, std::string(100000, static_cast<char>('a' + w)));
    });
  for (std::thread& writer : writers) writer.join();
  const std::string text = read_file(path);
  EXPECT_EQ(text, std::string(100000, text.front()));
  EXPECT_EQ(names_in(folder_), std::vector<std::string>{"a.txt"});
}

TEST_F(AtomicFileTest, MissingFolderIsAnIoErrorThatNamesThePath) {
  try {
    write_file_atomically(folder_ / "none" / "a.txt", "x");
    FAIL();
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("none"), std::string::npos);
    EXPECT_EQ(error.code(), ExitCode::io);
  }
}

TEST_F(AtomicFileTest, AFullDeviceIsAnIoErrorAndASpecialFileIsWrittenDirectly) {
  EXPECT_NO_THROW(write_file_atomically("/dev/null", "x"));
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_THROW(write_file_atomically("/dev/full", "x"), IoError);
}

TEST_F(AtomicFileTest, ReadingAFolderOrAMissingOrATooLargeFileIsAnInputError) {
  EXPECT_THROW(read_file(folder_), InputError);
  EXPECT_THROW(read_file(folder_ / "none"), InputError);
  write_file_atomically(folder_ / "b", "12345");
  EXPECT_THROW(read_file(folder_ / "b", 4), InputError);
}

TEST_F(AtomicFileTest, RemovesAFolderWithAllItHoldsButNotWhatALinkPointsTo) {
  fs::create_directories(folder_ / "a" / "b");
  write_file_atomically(folder_ / "a" / "b" / "x", "1");
  write_file_atomically(folder_ / "kept", "2");
  fs::create_symlink(folder_ / "kept", folder_ / "a" / "link");
  EXPECT_EQ(names_in(folder_ / "a"), (std::vector<std::string>{"b", "link"}));
  remove_path(folder_ / "a");
  EXPECT_FALSE(fs::exists(folder_ / "a"));
  EXPECT_EQ(read_file(folder_ / "kept"), "2");
  EXPECT_NO_THROW(remove_path(folder_ / "none"));
}

}  // namespace
}  // namespace graupel
