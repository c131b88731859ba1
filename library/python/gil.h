// Python's lock, which long calls give up. When the interpreter ends, a thread that is still in such a call must not
// take the lock again: Python would unwind its stack through code that may not throw, and so abort the process. It
// stays where it is until the process is gone.
#pragma once

#include <nanobind/nanobind.h>

namespace graupel::python {

/// Other Python threads run while this lives.
class WithoutGil {
 public:
  WithoutGil();
  ~WithoutGil();
  WithoutGil(const WithoutGil&) = delete;
  WithoutGil& operator=(const WithoutGil&) = delete;

 private:
  PyThreadState* state_;
};

/// The lock, inside of a WithoutGil or in a thread of ours.
class WithGil {
 public:
  WithGil();
  ~WithGil();
  WithGil(const WithGil&) = delete;
  WithGil& operator=(const WithGil&) = delete;

 private:
  PyGILState_STATE state_;
};

/// Does not return where the interpreter ends and this is not its main thread. For work without the lock.
void stay_if_ending();

/// Remembers the main thread, and has Python's atexit wait for calls of other threads to stay, a second at most.
void watch_end_of_interpreter(nanobind::module_& module);

}  // namespace graupel::python
