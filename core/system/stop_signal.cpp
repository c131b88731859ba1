#include "core/system/stop_signal.h"

#include <csignal>

#include "core/system/error.h"

namespace graupel {

namespace {
volatile std::sig_atomic_t caught = 0;
extern "C" void remember_signal(int signal) { caught = signal; }
}  // namespace

void catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  sigaction(SIGUSR1, &action, nullptr);  // batch systems may send it more than once
  action.sa_flags = SA_RESETHAND;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void release_stop_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) std::signal(signal, SIG_DFL);
}

int stop_signal() { return caught; }

int saved_exit_code() {
  if (caught == SIGINT) return static_cast<int>(ExitCode::interrupted);
  return caught == SIGUSR1 ? start_again_exit_code : 0;
}

}  // namespace graupel
