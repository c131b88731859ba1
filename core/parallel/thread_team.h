// Threads that ThreadSanitizer sees: it knows neither the barriers of OpenMP (libgomp) nor those of oneTBB, which it
// takes for none, so a build for it runs its parallel loops on these.
#pragma once

#ifdef __SANITIZE_THREAD__
#define GRAUPEL_THREAD_SANITIZER 1

#include <exception>
#include <thread>
#include <vector>

namespace graupel {

/// body(k) for every k < threads, all at once; body(0) on the calling thread. The error of the lowest k is thrown.
template <typename Body>
void run_team(int threads, const Body& body) {
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(threads));
  const auto run = [&](int k) {
    try {
      body(k);
    } catch (...) {
      errors[static_cast<std::size_t>(k)] = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  for (int k = 1; k < threads; ++k) others.emplace_back(run, k);
  run(0);
  for (std::thread& other : others) other.join();
  for (const std::exception_ptr& error : errors)
    if (error) std::rethrow_exception(error);
}

}  // namespace graupel

#endif
