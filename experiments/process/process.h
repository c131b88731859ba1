// What a run asks of the process it is in: whether to stop, its command line, its version.
#pragma once

#include <string>
#include <vector>

#include "core/system/stop_signal.h"

namespace graupel::experiments {

/// Whether Ctrl-C, SIGTERM or SIGUSR1 came; long loops ask after every frame and call stop_if_interrupted().
bool interrupted();

/// "graupel: warning: TEXT" on standard error, with the control characters of names made visible.
void warn(const std::string& text);

/// The command line of this process, quoted for a shell.
std::string command_line();
/// "graupel 0.1.0".
std::string version_text();

/// Becomes a program, looked for in PATH where it is a name alone. Returns only where it cannot be started.
void execute(const std::string& program, const std::vector<std::string>& arguments);

}  // namespace graupel::experiments
