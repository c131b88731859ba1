#include "core/system/file_lock.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "core/system/error.h"

namespace graupel {
namespace {

namespace fs = std::filesystem;

class FileLockTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("graupel_lock_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(FileLockTest, OneHolderOrSeveralSharers) {
  const std::string path = folder_ / "a";
  {
    const auto first = FileLock::attempt(path, LockKind::exclusive);
    ASSERT_TRUE(first);
    EXPECT_FALSE(FileLock::attempt(path, LockKind::exclusive));
    EXPECT_FALSE(FileLock::attempt(path, LockKind::shared));
  }
  const auto first = FileLock::attempt(path, LockKind::shared), second = FileLock::attempt(path, LockKind::shared);
  EXPECT_TRUE(first && second);
  EXPECT_FALSE(FileLock::attempt(path, LockKind::exclusive));
}

TEST_F(FileLockTest, WaitingExcludesAndOutlivesTheRemovalOfTheFile) {
  const std::string path = folder_ / "a";
  std::atomic<int> inside = 0, overlaps = 0, entered = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) {
        const FileLock lock = FileLock::wait(path);
        if (++inside > 1) ++overlaps;
        ++entered;
        --inside;
        if (i % 7 == 0) fs::remove(path);  // the last act of a holder
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(overlaps, 0);
  EXPECT_EQ(entered, 400);
}

/// Between fork and exec, as when another thread starts a program, a child has every descriptor.
TEST_F(FileLockTest, AJustForkedChildDoesNotKeepTheLock) {
  const std::string path = folder_ / "a";
  pid_t child = 0;
  {
    const auto held = FileLock::attempt(path, LockKind::exclusive);
    ASSERT_TRUE(held);
    child = ::fork();
    if (child == 0)
      for (;;) ::pause();
  }
  EXPECT_TRUE(FileLock::attempt(path, LockKind::exclusive));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

TEST_F(FileLockTest, AFolderThatIsNotThereIsAnIoError) {
  EXPECT_THROW(FileLock::wait(folder_ / "none" / "a"), IoError);
  EXPECT_THROW(FileLock::attempt(folder_ / "none" / "a", LockKind::shared), IoError);
}

}  // namespace
}  // namespace graupel
