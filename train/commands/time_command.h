// graupel-train time: parses the command line, times a graph network in libtorch, prints.
#pragma once

#include <CLI/CLI.hpp>

namespace graupel::train {

/// Adds the subcommand.
void add_time_command(CLI::App& app, const std::string& command_line);

}  // namespace graupel::train
