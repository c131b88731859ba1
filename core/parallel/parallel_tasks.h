// Loops over few and long tasks on CPU threads, each of which may throw.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <vector>

#include "core/parallel/parallel_for.h"
#include "core/parallel/thread_team.h"

namespace graupel {

/// What tasks that run at once have thrown.
class TaskErrors {
 public:
  explicit TaskErrors(std::size_t tasks) : errors_(tasks) {}
  /// body(i), whose error is kept.
  template <typename Body>
  void run(std::size_t i, const Body& body) {
    try {
      body(i);
    } catch (...) {
      errors_[i] = std::current_exception();
    }
  }
  /// Throws the error of the lowest i.
  void rethrow() const {
    for (const std::exception_ptr& error : errors_)
      if (error) std::rethrow_exception(error);
  }

 private:
  std::vector<std::exception_ptr> errors_;
};

/// body(i) for every i < n on up to `threads` threads, which take the next task when they have finished one. All tasks
/// are run; then the error of the lowest i is thrown. With one thread or one task it is a plain loop, whose kernels may
/// use all threads; else the kernels of a task run on its thread alone.
template <typename Body>
void for_each_task(std::size_t n, int threads, const Body& body) {
  TaskErrors errors(n);
  const int used = static_cast<int>(std::min<std::size_t>(n, static_cast<std::size_t>(std::max(1, threads))));
  if (used <= 1) {
    for (std::size_t i = 0; i < n; ++i) errors.run(i, body);
  } else {
#ifdef GRAUPEL_THREAD_SANITIZER
    std::atomic<std::size_t> next = 0;
    run_team(used, [&](int) {
      for (std::size_t i; (i = next++) < n;) errors.run(i, body);
    });
#else
#pragma omp parallel for schedule(dynamic) num_threads(used)
    for (std::size_t i = 0; i < n; ++i) errors.run(i, body);
#endif
  }
  errors.rethrow();
}

/// The same on the threads of parallel_for_cpu.
template <typename Body>
void for_each_pool_task(std::size_t n, const Body& body) {
  TaskErrors errors(n);
  parallel_for_cpu(
      static_cast<int64_t>(n), [&](int64_t i) { errors.run(static_cast<std::size_t>(i), body); }, Grain{1});
  errors.rethrow();
}

}  // namespace graupel
