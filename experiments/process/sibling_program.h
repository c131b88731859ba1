// graupel-train, the program beside this one and the only one linked with libtorch.
#pragma once

#include <string>
#include <vector>

namespace graupel::experiments {

/// Its path. Throws ConfigError where this build has none.
std::string training_program();

/// This process goes on as that program, with these arguments. Returns only by Error, where it cannot be started.
[[noreturn]] void become_training_program(const std::vector<std::string>& arguments);

/// Runs it to its end; it prints to this program's standard error. Throws Error with its exit code unless that is 0,
/// and ExitCode::interrupted after Ctrl-C or SIGTERM, which end it too.
void run_training_program(const std::vector<std::string>& arguments);

}  // namespace graupel::experiments
