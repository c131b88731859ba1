// What the main functions of graupel and graupel-bench share.
#pragma once

#include <functional>

#include "core/system/command_line.h"

namespace graupel::experiments {

/// Text on GRAUPEL_SIMD and GRAUPEL_PRODUCTS for --help.
extern const char* const environment_help;

/// Runs the command that the words name, with the spinning of OpenMP's threads limited (the program starts itself once
/// more for that), the instruction set chosen and Ctrl-C caught. Errors become messages under `name`. Returns the exit
/// code; `declare` adds the commands, and sets `exit_code` where a command has one of its own.
int run_program(int argc, char** argv, const char* name, const char* description,
                const std::function<void(const CommandLine& program, int& exit_code)>& declare);

}  // namespace graupel::experiments
