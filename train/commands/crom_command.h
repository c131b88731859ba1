// graupel-train crom: parses the command line, trains, writes the run folder.
#pragma once

#include <string>

#include "core/system/command_line.h"

namespace graupel::train {

/// Adds the subcommand; its callback sets `exit_code`.
void add_crom_command(const Command& app, const std::string& command_line, int& exit_code);

}  // namespace graupel::train
