#include "library/python/gil.h"

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>

namespace graupel::python {

namespace {

std::atomic<bool> ending = false;
std::atomic<int> busy = 0;  ///< threads that are in a call without the lock, or wait for it
std::thread::id main_thread;

void end_calls() {
  ending = true;
  PyThreadState* const state = PyEval_SaveThread();
  for (int i = 0; i < 1000 && busy > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  PyEval_RestoreThread(state);
}

}  // namespace

void stay_if_ending() {
  if (!ending || std::this_thread::get_id() == main_thread) return;
  --busy;
  for (;;) ::pause();
}

WithoutGil::WithoutGil() : state_(nullptr) {
  ++busy;
  state_ = PyEval_SaveThread();
}
WithoutGil::~WithoutGil() {
  stay_if_ending();
  PyEval_RestoreThread(state_);
  --busy;
}

WithGil::WithGil() {
  stay_if_ending();
  state_ = PyGILState_Ensure();
}
WithGil::~WithGil() { PyGILState_Release(state_); }

void watch_end_of_interpreter(nanobind::module_& module) {
  main_thread = std::this_thread::get_id();
  module.def("_end_calls", &end_calls, "At the end of the interpreter: no thread comes back from a call.");
  nanobind::module_::import_("atexit").attr("register")(module.attr("_end_calls"));
}

}  // namespace graupel::python
