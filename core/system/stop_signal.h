// Ctrl-C, SIGTERM and SIGUSR1: remembered, so that long loops can end between two steps.
#pragma once

namespace graupel {

/// From now on the first SIGINT or SIGTERM, and every SIGUSR1, is remembered; a second SIGINT or SIGTERM ends the
/// process at once.
void catch_stop_signals();
/// From now on each of these signals ends the process at once: for work that asks for none and leaves nothing behind.
void release_stop_signals();
/// The signal that came, 0 for none.
int stop_signal();

/// Exit code after SIGUSR1, by which batch systems tell that the time is nearly over: all is saved, start again to go
/// on (EX_TEMPFAIL of sysexits.h).
inline constexpr int start_again_exit_code = 75;
/// Exit code of a run that has saved its state because of stop_signal(): ExitCode::interrupted after SIGINT,
/// start_again_exit_code after SIGUSR1, else 0.
int saved_exit_code();

}  // namespace graupel
