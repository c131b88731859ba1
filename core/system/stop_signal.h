// Ctrl-C and SIGTERM: remembered, so that long loops can end between two steps.
#pragma once

namespace graupel {

/// From now on the first SIGINT or SIGTERM is remembered; a second one ends the process at once.
void catch_stop_signals();
/// From now on either signal ends the process at once: for work that asks for none and leaves nothing behind.
void release_stop_signals();
/// The signal that came, 0 for none.
int stop_signal();

}  // namespace graupel
