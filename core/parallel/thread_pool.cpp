#include "core/parallel/thread_pool.h"

#include <omp.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <new>

#include "core/parallel/device.h"
#include "core/parallel/thread_team.h"

namespace graupel {

namespace {

/// The slot of a thread in the region that it works in; -1 outside.
thread_local int slot_in_region = -1;

struct InRegion {
  explicit InRegion(int slot) { slot_in_region = slot; }
  ~InRegion() { slot_in_region = -1; }
};

#ifdef GRAUPEL_THREAD_SANITIZER
/// OpenVDB's loops, which run on oneTBB, have one thread.
const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
#endif

/// What the first of some threads has thrown. The scheduler itself would need memory to hand it on.
class FirstError {
 public:
  void keep() noexcept {
    if (!taken_.test_and_set()) error_ = std::current_exception();
  }
  /// When all threads are done.
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::atomic_flag taken_;
  std::exception_ptr error_;
};

/// Arenas are never destroyed: a worker may still be in one when the program ends.
tbb::task_arena& arena_of(int threads) {
  static std::mutex mutex;
  static auto& arenas = *new std::map<int, std::unique_ptr<tbb::task_arena>>;
  const std::lock_guard lock(mutex);
  auto& arena = arenas[threads];
  if (!arena) arena = std::make_unique<tbb::task_arena>(threads);
  return *arena;
}

}  // namespace

// One task a thread, and each takes chunks by a counter. A task that no worker has started is done by the caller, who
// finds the counter at its end: so a barrier waits for threads that run, not for those that the scheduler has set
// aside. (OpenMP's implicit barrier waits for all: with one busy neighbour on two cores it tripled the time of a
// substep.)
void run_chunks(int64_t chunks, const void* context, void (*run)(const void* context, int64_t chunk)) {
  const int threads = static_cast<int>(std::min<int64_t>(num_threads(), chunks));
  if (threads <= 1 || slot_in_region >= 0 || omp_in_parallel() != 0) {
    for (int64_t c = 0; c < chunks; ++c) run(context, c);
    return;
  }
  std::atomic<int64_t> next{0};
  FirstError error;
  const auto take_chunks = [&](int slot) {
    const InRegion region(slot);
    try {
      for (int64_t c; (c = next.fetch_add(1, std::memory_order_relaxed)) < chunks;) run(context, c);
    } catch (...) {
      error.keep();
      next = chunks;
    }
  };
#ifdef GRAUPEL_THREAD_SANITIZER
  run_team(threads, take_chunks);
#else
  const auto of_this_thread = [&](int) { take_chunks(tbb::this_task_arena::current_thread_index()); };
  try {
    arena_of(num_threads()).execute([&] { tbb::parallel_for(0, threads, of_this_thread, tbb::simple_partitioner()); });
  } catch (const std::bad_alloc&) {  // of the scheduler's own tasks
    take_chunks(0);
  }
#endif
  error.rethrow();
}

int thread_slot() { return std::max(0, slot_in_region); }

}  // namespace graupel
