// A task beside the calling thread.
#pragma once

#include <future>
#include <memory>
#include <system_error>
#include <utility>

namespace graupel {

/// std::async on a new thread; where the system starts none, get() of the result runs the task.
template <typename Body>
auto start_task(Body body) {
  const auto task = std::make_shared<Body>(std::move(body));
  const auto run = [task] { return (*task)(); };
  try {
    return std::async(std::launch::async, run);
  } catch (const std::system_error&) {
    return std::async(std::launch::deferred, run);
  }
}

}  // namespace graupel
