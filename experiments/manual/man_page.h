// Man pages of section 1 from the description of a command line, one for the program and one for each command.
#pragma once

#include <string>
#include <vector>

#include "core/system/command_description.h"

namespace graupel::experiments {

struct ManPage {
  std::string name;  ///< graupel, graupel-train, graupel-train-hgn; the file is NAME.1
  std::string text;  ///< macros of man(7) in ASCII
};

/// `date` is written YYYY-MM-DD.
std::vector<ManPage> man_pages(const CommandDescription& program, const std::string& version, const std::string& date);

}  // namespace graupel::experiments
