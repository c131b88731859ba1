#include "core/system/stop_signal.h"

#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "core/system/unfinished_file.h"

namespace graupel {

namespace {

constexpr itimerval grace = {{0, 0}, {0, 800'000}};  ///< less than the second that is promised

// Read by other threads than the one that the signal interrupts.
std::atomic<int> caught = 0;
std::atomic<StopPolicy> policy_now = StopPolicy::finish;
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<StopPolicy>::is_always_lock_free);

bool ends_process(int signal) { return signal == SIGINT || signal == SIGTERM; }

void print(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) return;  // there is nobody else to tell
}

/// Plain system calls alone, as it runs in signal handlers.
[[noreturn]] void end_process() {
  remove_unfinished_files();
  if (policy_now == StopPolicy::usual_end) ::_exit(static_cast<int>(ExitCode::ok));
  print(program_invocation_short_name);
  print(": interrupted\n");
  ::_exit(static_cast<int>(ExitCode::interrupted));
}

void act_on_stop() {
  const StopPolicy policy = policy_now;
  if (policy == StopPolicy::at_once) end_process();
  if (policy == StopPolicy::within_a_second || policy == StopPolicy::usual_end)
    ::setitimer(ITIMER_REAL, &grace, nullptr);
}

extern "C" void remember_signal(int signal) {
  const bool again = ends_process(caught);
  if (!again) caught = signal;
  if (!ends_process(signal)) return;
  if (again) end_process();
  const int error = errno;
  act_on_stop();
  errno = error;
}

extern "C" void end_after_grace(int) {
  if (policy_now != StopPolicy::finish) end_process();
}

void set_policy(StopPolicy policy) {
  policy_now = policy;
  if (ends_process(caught)) act_on_stop();
}

}  // namespace

void catch_stop_signals(StopPolicy policy) {
  set_policy(policy);
  struct sigaction action {};
  action.sa_flags = SA_RESTART;  // reading and writing go on
  action.sa_handler = end_after_grace;
  sigaction(SIGALRM, &action, nullptr);
  action.sa_handler = remember_signal;
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaction(signal, &action, nullptr);
}

int stop_signal() { return caught; }

StopPolicyScope::StopPolicyScope(StopPolicy policy) : before_(policy_now) { set_policy(policy); }

StopPolicyScope::~StopPolicyScope() { set_policy(before_); }

void stop_if_interrupted(const std::string& what_now, AfterStop after) {
  if (caught != 0) throw_interrupted(what_now, after);
}

void throw_interrupted(const std::string& what_now, AfterStop after) {
  const bool start_again = caught == SIGUSR1 && after == AfterStop::goes_on;
  const ExitCode code = start_again ? ExitCode{start_again_exit_code} : ExitCode::interrupted;
  throw StoppedError(code, "interrupted" + what_now);
}

void give_up_if_stopped() {
  if (policy_now != StopPolicy::finish) stop_if_interrupted();
}

int saved_exit_code() {
  if (ends_process(caught)) return static_cast<int>(ExitCode::interrupted);
  return caught == SIGUSR1 ? start_again_exit_code : 0;
}

}  // namespace graupel
