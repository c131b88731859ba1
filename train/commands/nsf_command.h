// graupel-train nsf: parses the command line, trains, writes the run folder.
#pragma once

#include <CLI/CLI.hpp>

namespace graupel::train {

/// Adds the subcommand; its callback sets `exit_code`.
void add_nsf_command(CLI::App& app, const std::string& command_line, int& exit_code);

}  // namespace graupel::train
