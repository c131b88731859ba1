// graupel-train time: parses the command line, times a graph network in libtorch, prints.
#pragma once

#include <string>

#include "core/system/command_line.h"

namespace graupel::train {

/// Adds the subcommand.
void add_time_command(const Command& app, const std::string& command_line);

}  // namespace graupel::train
