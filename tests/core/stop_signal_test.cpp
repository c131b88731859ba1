#include "core/system/stop_signal.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "core/system/unfinished_file.h"

namespace graupel {
namespace {

constexpr int finished_by_itself = 7;

struct End {
  int exit_code = -1;
  double seconds = 0;  ///< after the first signal
};

/// Runs `work` in a process of its own, which is sent these signals, a tenth of a second apart, once it has begun.
End end_of(const std::function<void()>& work, const std::vector<int>& signals) {
  int ends[2];
  EXPECT_EQ(::pipe(ends), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    catch_stop_signals(StopPolicy::within_a_second);
    EXPECT_EQ(::write(ends[1], "x", 1), 1);
    work();
    ::_exit(finished_by_itself);
  }
  char begun = 0;
  EXPECT_EQ(::read(ends[0], &begun, 1), 1);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const auto begin = std::chrono::steady_clock::now();
  for (const int signal : signals) {
    ::kill(child, signal);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ::close(ends[0]);
  ::close(ends[1]);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count()};
}

void work_for(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

TEST(StopSignal, WorkThatDoesNotAskEndsWithinASecond) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const End end = end_of([] { work_for(20); }, {signal});
    EXPECT_EQ(end.exit_code, 130);
    EXPECT_GT(end.seconds, 0.6);
    EXPECT_LT(end.seconds, 3);
  }
}

TEST(StopSignal, WorkThatAsksEndsInItsOwnWay) {
  const End end = end_of(
      [] {
        while (stop_signal() == 0) work_for(0.01);
      },
      {SIGTERM});
  EXPECT_EQ(end.exit_code, finished_by_itself);
}

TEST(StopSignal, WhatWouldBeLostIsFinishedFirst) {
  const End end = end_of(
      [] {
        const StopPolicyScope saves(StopPolicy::finish);
        work_for(1.5);
      },
      {SIGINT});
  EXPECT_EQ(end.exit_code, finished_by_itself);
  const End after = end_of(
      [] {
        {
          const StopPolicyScope saves(StopPolicy::finish);
          work_for(1);
        }
        work_for(20);
      },
      {SIGINT});
  EXPECT_EQ(after.exit_code, 130);
  EXPECT_LT(after.seconds, 5);
}

TEST(StopSignal, WhereNothingIsLostTheProcessEndsAtOnce) {
  const End end = end_of(
      [] {
        const StopPolicyScope nothing_is_lost(StopPolicy::at_once);
        work_for(20);
      },
      {SIGINT});
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_LT(end.seconds, 0.6);
}

TEST(StopSignal, ASecondSignalEndsTheProcessAtOnce) {
  const End end = end_of(
      [] {
        const StopPolicyScope saves(StopPolicy::finish);
        work_for(20);
      },
      {SIGINT, SIGTERM});
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_LT(end.seconds, 2);
}

/// Batch systems send it some time before the end, more than once.
TEST(StopSignal, TheSignalOfBatchSystemsLeavesTime) {
  const End end = end_of([] { work_for(1.5); }, {SIGUSR1, SIGUSR1});
  EXPECT_EQ(end.exit_code, finished_by_itself);
}

TEST(StopSignal, LibrariesGiveUpUnlessWorkIsToBeFinished) {
  const End end = end_of(
      [] {
        while (stop_signal() == 0) work_for(0.01);
        {
          const StopPolicyScope saves(StopPolicy::finish);
          give_up_if_stopped();
        }
        try {
          give_up_if_stopped();
        } catch (const StoppedError& error) {
          ::_exit(static_cast<int>(error.code()));
        }
      },
      {SIGINT});
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_LT(end.seconds, 0.6);  // not by the end of the grace
}

TEST(StopSignal, UnfinishedFilesAreRemoved) {
  const std::string name =
      (std::filesystem::temp_directory_path() / ("graupel_stop_" + std::to_string(::getpid()))).string();
  const auto write = [](const std::string& file) { std::ofstream(file) << "half"; };
  const End end = end_of(
      [&] {
        const UnfinishedFile half(name + ".half");
        UnfinishedFile whole(name + ".whole");
        write(half.path());
        write(whole.path());
        whole.keep();
        work_for(20);
      },
      {SIGINT});
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_FALSE(std::filesystem::exists(name + ".half"));
  EXPECT_TRUE(std::filesystem::exists(name + ".whole"));
  std::filesystem::remove(name + ".whole");
}

TEST(UnfinishedFile, GoesWithItsObjectUnlessItIsKept) {
  const std::string name =
      (std::filesystem::temp_directory_path() / ("graupel_half_" + std::to_string(::getpid()))).string();
  for (int i = 0; i < 200; ++i) {  // more than the list for signals holds at once
    UnfinishedFile file(name);
    std::ofstream(name) << "x";
  }
  EXPECT_FALSE(std::filesystem::exists(name));
  {
    UnfinishedFile file(name);
    std::ofstream(name) << "x";
    file.keep();
  }
  EXPECT_TRUE(std::filesystem::exists(name));
  std::filesystem::remove(name);
}

}  // namespace
}  // namespace graupel
