// Man pages of this build of graupel: dated, chosen, written.
#pragma once

#include <string>
#include <vector>

#include "core/system/command_description.h"
#include "experiments/manual/man_page.h"

namespace graupel::experiments {

/// All pages, of this version and with the date of the program's file, or of SOURCE_DATE_EPOCH where that is set.
std::vector<ManPage> program_man_pages(const CommandDescription& program);

/// The page of a command ("train", "hgn"; none: the program). Throws ConfigError, with the closest name.
const ManPage& find_page(const std::vector<ManPage>& pages, const std::vector<std::string>& command);

/// Each as NAME.1. Makes the folder. Throws IoError.
void write_pages(const std::vector<ManPage>& pages, const std::string& folder);

}  // namespace graupel::experiments
