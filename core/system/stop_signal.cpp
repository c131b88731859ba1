#include "core/system/stop_signal.h"

#include <csignal>

namespace graupel {

namespace {
volatile std::sig_atomic_t caught = 0;
extern "C" void remember_signal(int signal) { caught = signal; }
}  // namespace

void catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  action.sa_flags = SA_RESETHAND;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void release_stop_signals() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

int stop_signal() { return caught; }

}  // namespace graupel
