// Ctrl-C, SIGTERM and SIGUSR1: remembered, so that long loops can end between two steps; and the end of work that does
// not ask.
#pragma once

#include "core/system/error.h"

namespace graupel {

/// What the first SIGINT or SIGTERM does beside being remembered. A second one ends the process at once. Where a signal
/// ends the process, unfinished files are removed, and the exit code is ExitCode::interrupted, but of usual_end.
enum class StopPolicy {
  finish,           ///< nothing: the work asks stop_signal() and saves what would be lost
  within_a_second,  ///< work that asks ends in its own way; where it has not ended after a second, the process ends
  usual_end,        ///< the same for work that a signal always ends: with ExitCode::ok, and without a word
  at_once           ///< the process ends: for work that leaves nothing behind
};

/// From now on SIGINT, SIGTERM and SIGUSR1 are remembered, the latter without any other effect.
void catch_stop_signals(StopPolicy policy = StopPolicy::finish);
/// The signal that came, 0 for none.
int stop_signal();

/// Another policy while this lives. Of the main thread.
class StopPolicyScope {
 public:
  explicit StopPolicyScope(StopPolicy policy);
  ~StopPolicyScope();
  StopPolicyScope(const StopPolicyScope&) = delete;
  StopPolicyScope& operator=(const StopPolicyScope&) = delete;

 private:
  StopPolicy before_;
};

/// Work that was given up because of stop_signal().
struct StoppedError : Error {
  using Error::Error;
};
/// Whether the same work goes on from what is kept: only then does SIGUSR1 give start_again_exit_code, or a batch
/// system would begin it anew for ever.
enum class AfterStop { begins_anew, goes_on };
/// Throws StoppedError once a signal came; `what_now` ends its text.
void stop_if_interrupted(const std::string& what_now = "", AfterStop after = AfterStop::begins_anew);
[[noreturn]] void throw_interrupted(const std::string& what_now, AfterStop after = AfterStop::begins_anew);
/// The same for long loops inside of libraries; no effect where the policy is to finish.
void give_up_if_stopped();

/// Exit code after SIGUSR1, by which batch systems tell that the time is nearly over: all is saved, start again to go
/// on (EX_TEMPFAIL of sysexits.h).
inline constexpr int start_again_exit_code = 75;
/// Exit code of a run that has saved its state because of stop_signal(): ExitCode::interrupted after SIGINT and
/// SIGTERM, start_again_exit_code after SIGUSR1, else 0.
int saved_exit_code();

}  // namespace graupel
