// A loop over few and long tasks on CPU threads, each of which may throw.
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <vector>

namespace graupel {

/// body(i) for every i < n on up to `threads` threads, which take the next task when they have finished one. All tasks
/// are run; then the error of the lowest i is thrown. With one thread or one task it is a plain loop, whose kernels may
/// use all threads; else the kernels of a task run on its thread alone.
template <typename Body>
void for_each_task(std::size_t n, int threads, const Body& body) {
  std::vector<std::exception_ptr> failures(n);
  const auto run = [&](std::size_t i) {
    try {
      body(i);
    } catch (...) {
      failures[i] = std::current_exception();
    }
  };
  const int used = static_cast<int>(std::min<std::size_t>(n, static_cast<std::size_t>(std::max(1, threads))));
  if (used <= 1) {
    for (std::size_t i = 0; i < n; ++i) run(i);
  } else {
#pragma omp parallel for schedule(dynamic) num_threads(used)
    for (std::size_t i = 0; i < n; ++i) run(i);
  }
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

}  // namespace graupel
