#include "core/system/atomic_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "core/system/error.h"
#include "core/system/output_files.h"

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

TEST_F(AtomicFileTest, LinksAreFollowed) {
  fs::create_directories(folder_ / "elsewhere");
  const std::string file = folder_ / "elsewhere/a.txt", link = folder_ / "link", second = folder_ / "second";
  fs::create_symlink("elsewhere/a.txt", link);
  fs::create_symlink(link, second);
  EXPECT_EQ(follow_links(second).path, (folder_ / "elsewhere/a.txt").string());
  write_file_atomically(second, "one");  // the file is not there yet
  EXPECT_EQ(read_file(file), "one");
  write_part_file(link, [](const std::string& part) { write_file_atomically(part, "two"); });
  EXPECT_EQ(read_file(file), "two");
  EXPECT_TRUE(fs::is_symlink(link) && fs::is_symlink(second));
  check_library_output(link);
  EXPECT_EQ(names_in(folder_), (std::vector<std::string>{"elsewhere", "link", "second"}));
  EXPECT_EQ(names_in(folder_ / "elsewhere"), std::vector<std::string>{"a.txt"});

  const std::string circle = folder_ / "circle", nowhere = folder_ / "nowhere", open_file = folder_ / "open";
  fs::create_symlink(circle, circle);
  fs::create_symlink("none/a.txt", nowhere);
  fs::create_symlink("/proc/self/fd/1", open_file);
  EXPECT_THROW(check_output_file(circle), IoError);
  EXPECT_THROW(write_file_atomically(circle, "x"), IoError);
  EXPECT_THROW(check_output_file(nowhere), IoError);
  EXPECT_THROW(check_library_output(open_file), IoError);
  EXPECT_TRUE(follow_links(open_file).open_file);
  EXPECT_TRUE(follow_links("/dev/stdout").open_file || !fs::is_symlink("/dev/stdout"));
}

TEST_F(AtomicFileTest, NamesThatAreTooLongAreRefusedBeforeTheWork) {
  const std::string longest = folder_ / std::string(230, 'x'), too_long = folder_ / std::string(240, 'x');
  check_output_file(longest);
  write_file_atomically(longest, "one");
  EXPECT_THROW(check_output_file(too_long), IoError);
  check_apart({}, {{"a", folder_ / std::string(300, 'x')}, {"b", folder_ / std::string(300, 'y')}});
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
