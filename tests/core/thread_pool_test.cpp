// The threads behind parallel_for: every item once, slots of their own, nested regions, errors, a busy neighbour.
#include "core/parallel/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/parallel/device.h"
#include "core/parallel/parallel_for.h"
#include "core/parallel/parallel_tasks.h"

namespace graupel {
namespace {

class ThreadPool : public ::testing::Test {
 protected:
  void SetUp() override {
    before_ = num_threads();
    set_num_threads(4);
  }
  void TearDown() override { set_num_threads(before_); }

 private:
  int before_ = 0;
};

TEST_F(ThreadPool, EveryItemIsDoneOnce) {
  std::vector<std::atomic<int>> times(10007);
  parallel_for_cpu(
      10007, [&](int64_t i) { ++times[static_cast<std::size_t>(i)]; }, Grain{3});
  for (const auto& one : times) EXPECT_EQ(one, 1);
}

TEST_F(ThreadPool, SlotsAreBelowTheNumberOfThreadsAndNoTwoThreadsShareOne) {
  std::vector<std::atomic<int>> inside(4);
  std::atomic<int> shared = 0, outside = 0;
  parallel_for_cpu(
      400,
      [&](int64_t) {
        const int slot = thread_slot();
        if (slot < 0 || slot >= 4) {
          ++outside;
          return;
        }
        if (++inside[static_cast<std::size_t>(slot)] > 1) ++shared;
        std::this_thread::sleep_for(std::chrono::microseconds(50));
        --inside[static_cast<std::size_t>(slot)];
      },
      Grain{1});
  EXPECT_EQ(outside, 0);
  EXPECT_EQ(shared, 0);
  EXPECT_EQ(thread_slot(), 0);
}

TEST_F(ThreadPool, WorkIsSharedAmongThreads) {
  std::vector<std::atomic<int>> items(4);
  parallel_for_cpu(
      64,
      [&](int64_t) {
        ++items[static_cast<std::size_t>(thread_slot())];
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      },
      Grain{1});
  int at_work = 0;
  for (const auto& one : items) at_work += one > 0;
  EXPECT_GT(at_work, 1);
}

TEST_F(ThreadPool, ANestedRegionStaysOnItsThread) {
  std::atomic<int> strayed = 0, items = 0;
  parallel_for_cpu(
      16,
      [&](int64_t) {
        const auto thread = std::this_thread::get_id();
        const int slot = thread_slot();
        parallel_for_cpu(
            8,
            [&](int64_t) {
              ++items;
              strayed += thread != std::this_thread::get_id() || slot != thread_slot();
            },
            Grain{1});
      },
      Grain{1});
  EXPECT_EQ(items, 128);
  EXPECT_EQ(strayed, 0);
}

TEST_F(ThreadPool, RegionsOfSeveralCallersAtOnceAreComplete) {
  std::atomic<int64_t> sum = 0;
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 6; ++caller)
    callers.emplace_back([&] {
      set_num_threads(4);
      for (int round = 0; round < 50; ++round)
        parallel_for_cpu(
            100, [&](int64_t i) { sum += i; }, Grain{1});
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(sum, 6 * 50 * 4950);
}

TEST_F(ThreadPool, AnErrorReachesTheCallerAndTheNextRegionWorks) {
  const auto fail = [](int64_t i) {
    if (i == 37) throw std::runtime_error("item 37");
  };
  EXPECT_THROW(parallel_for_cpu(100, fail, Grain{1}), std::runtime_error);
  std::atomic<int> items = 0;
  parallel_for_cpu(
      100, [&](int64_t) { ++items; }, Grain{1});
  EXPECT_EQ(items, 100);
}

TEST_F(ThreadPool, OneThreadRunsInOrder) {
  set_num_threads(1);
  std::vector<int64_t> order;
  parallel_for_cpu(
      50, [&](int64_t i) { order.push_back(i); }, Grain{1});
  std::vector<int64_t> expected(50);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(order, expected);
}

/// Many short regions while a thread of this process keeps every core busy: a barrier that waits for all threads takes
/// a time slice (milliseconds) for each region.
TEST_F(ThreadPool, BusyCoresDoNotStopShortRegions) {
  std::atomic<bool> stop = false;
  std::vector<std::thread> neighbours;
  for (unsigned core = 0; core < std::max(1u, std::thread::hardware_concurrency()); ++core)
    neighbours.emplace_back([&] {
      while (!stop) {
      }
    });
  const auto work = [](int64_t i) {
    volatile int64_t x = i;
    for (int k = 0; k < 2000; ++k) x = x + k;
  };
  const auto seconds = [&](int threads) {
    set_num_threads(threads);
    const auto begin = std::chrono::steady_clock::now();
    for (int region = 0; region < 400; ++region) parallel_for_cpu(32, work, Grain{1});
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  double alone = seconds(1), together = seconds(2);
  for (int again = 0; again < 4 && together > 2 * alone; ++again) {
    alone = std::max(alone, seconds(1));
    together = std::min(together, seconds(2));
  }
  stop = true;
  for (std::thread& neighbour : neighbours) neighbour.join();
  EXPECT_LT(together, 2 * alone);
}

TEST_F(ThreadPool, TasksAreAllRunAndTheFirstErrorIsThrown) {
  constexpr int pool = 0;  // the threads of parallel_for_cpu
  for (const int threads : {1, 4, pool}) {
    std::vector<std::atomic<int>> times(50);
    try {
      const auto task = [&](std::size_t i) {
        ++times[i];
        if (i == 7 || i == 31) throw std::runtime_error("task " + std::to_string(i));
      };
      if (threads == pool)
        for_each_pool_task(times.size(), task);
      else
        for_each_task(times.size(), threads, task);
      ADD_FAILURE() << threads;
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "task 7");
    }
    for (const auto& one : times) EXPECT_EQ(one, 1);
  }
}

TEST_F(ThreadPool, TasksRunAtOnceAndASingleOneHasAllThreads) {
  std::atomic<int> inside = 0, met = 0;
  for_each_task(2, 2, [&](std::size_t) {
    ++inside;
    for (int tries = 0; inside < 2 && tries < 20000; ++tries)
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    if (inside == 2) ++met;
  });
  EXPECT_EQ(met, 2);
  std::atomic<int> other_threads = 0;
  for_each_task(1, 4, [&](std::size_t) {
    const auto own = std::this_thread::get_id();
    parallel_for_cpu(
        400,
        [&](int64_t) {
          if (std::this_thread::get_id() != own) ++other_threads;
          std::this_thread::sleep_for(std::chrono::microseconds(50));
        },
        Grain{1});
  });
  EXPECT_GT(other_threads, 0);
}

}  // namespace
}  // namespace graupel
