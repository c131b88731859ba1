// Processes that check files, with a checker that misbehaves.
#include "core/system/checks/file_check.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/system/checks/checker_process.h"
#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "core/system/stopwatch.h"

namespace graupel {
namespace {

constexpr const char* misbehaving = MISBEHAVING_CHECKER;
constexpr CheckRequest small = {.memory = uint64_t(64) << 20, .seconds = 1, .path_length = 0};

TEST(FileCheck, SaysWhatHappenedAndGoesOn) {
  CheckerProcess process;
  EXPECT_EQ(process.check(misbehaving, "/good", small), "");
  EXPECT_EQ(process.check(misbehaving, "/crash", small), "crashed on it: Segmentation fault");
  EXPECT_EQ(process.check(misbehaving, "/good", small), "");
  EXPECT_EQ(process.check(misbehaving, "/allocate", small), "wants more than 64 MiB of memory for it");
  EXPECT_EQ(process.check(misbehaving, "/exit", small), "ended the process that tried it, with status 7");
  EXPECT_EQ(process.check(misbehaving, "/good", small), "");
}

TEST(FileCheck, ALoopEndsByItself) {
  CheckerProcess process;
  EXPECT_EQ(process.check(misbehaving, "/loop", small), "does not come to an end with it");
}

TEST(FileCheck, AProcessThatCannotBeStartedIsNamed) {
  CheckerProcess process;
  try {
    process.check("/no/such/checker", "/good", small);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/no/such/checker"), std::string::npos);
  }
}

TEST(FileCheck, ASignalEndsItAtOnce) {
  const Stopwatch watch;
  const pid_t child = ::fork();
  if (child == 0) {
    catch_stop_signals();
    std::thread later([] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      ::kill(::getpid(), SIGTERM);
    });
    later.detach();
    try {
      CheckerProcess().check(misbehaving, "/sleep", {.memory = small.memory, .seconds = 60, .path_length = 0});
    } catch (const StoppedError&) {
      ::_exit(0);
    }
    ::_exit(1);
  }
  int status = 1;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_LT(watch.seconds(), 20);
}

/// Processes whose program is the misbehaving checker and that loop in this test.
int checkers_that_run() {
  int count = 0;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", code))
    if (std::filesystem::read_symlink(entry.path() / "exe", code) == misbehaving && !code) ++count;
  return count;
}

TEST(FileCheck, ACheckerEndsWithItsParent) {
  const int before = checkers_that_run();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    CheckerProcess process;
    process.check(misbehaving, "/loop", {.memory = small.memory, .seconds = 600, .path_length = 0});
    ::_exit(0);
  }
  const auto waits_for = [&](int count) {
    for (int i = 0; i < 400 && checkers_that_run() != count; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return checkers_that_run() == count;
  };
  EXPECT_TRUE(waits_for(before + 1));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(waits_for(before));
}

TEST(FileCheck, AForkHasACheckerOfItsOwn) {
  CheckerProcess process;
  EXPECT_EQ(process.check(misbehaving, "/good", small), "");
  const pid_t child = ::fork();
  if (child == 0) ::_exit(process.check(misbehaving, "/crash", small).starts_with("crashed") ? 0 : 1);
  int status = 1;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(process.check(misbehaving, "/good", small), "");
}

/// GRAUPEL_CHECKERS for the time of a test.
class NamedFolder {
 public:
  explicit NamedFolder(const std::string& folder) { ::setenv("GRAUPEL_CHECKERS", folder.c_str(), 1); }
  ~NamedFolder() { ::unsetenv("GRAUPEL_CHECKERS"); }
};

TEST(FileCheck, TheEnvironmentNamesTheFolderOrTurnsChecksOff) {
  const std::string folder = testing::TempDir() + "graupel_checkers_" + std::to_string(::getpid()),
                    file = folder + "/a crash.h5";
  std::filesystem::create_directories(folder);
  std::ofstream(file) << "some bytes";
  {
    const NamedFolder named("/no/such/folder");
    EXPECT_EQ(checker_of(FileFormat::hdf5), "");
    try {
      check_file(file, FileFormat::hdf5);
      ADD_FAILURE() << "read unchecked";
    } catch (const ConfigError& error) {
      for (const char* part : {"graupel-check-hdf5", "GRAUPEL_CHECKERS"})
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
  {
    const NamedFolder named("none");
    EXPECT_TRUE(checks_are_off());
    EXPECT_NO_THROW(check_file(file, FileFormat::hdf5));
  }
  std::filesystem::create_symlink(misbehaving, folder + "/graupel-check-hdf5");
  {
    const NamedFolder named(folder);
    EXPECT_EQ(checker_of(FileFormat::hdf5), folder + "/graupel-check-hdf5");
    try {
      check_file(file, FileFormat::hdf5);
      ADD_FAILURE() << "read";
    } catch (const InputError& error) {
      for (const char* part : {"a crash.h5", "the HDF5 library crashed on it: Segmentation fault", "make it again"})
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
    EXPECT_THROW(check_file(folder, FileFormat::hdf5), InputError);  // no regular file
    EXPECT_NO_THROW(check_file(folder + "/missing", FileFormat::hdf5));
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace graupel
