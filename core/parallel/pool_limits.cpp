#include "core/parallel/pool_limits.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

namespace graupel {

int startable_threads(int wanted) {
  std::mutex until_all_are;
  std::unique_lock hold(until_all_are);
  std::vector<std::thread> threads;
  try {
    threads.reserve(static_cast<std::size_t>(std::max(0, wanted)));
    while (static_cast<int>(threads.size()) + 1 < wanted)
      threads.emplace_back([&] { const std::lock_guard wait(until_all_are); });
  } catch (const std::system_error&) {
  }
  hold.unlock();
  for (std::thread& thread : threads) thread.join();
  return static_cast<int>(threads.size()) + 1;
}

void limit_pool(int threads) {
  static auto& limit = *new std::optional<tbb::global_control>;
  limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(std::max(1, threads)));
}

}  // namespace graupel
