// Names that scenes give, as names of files.
#pragma once

#include <algorithm>
#include <string>

namespace graupel::experiments {

/// `name` with '_' for '/' and for control characters: the file is in the folder that it is meant for.
inline std::string file_name_of(std::string name) {
  const auto no_part_of_names = [](unsigned char c) { return c == '/' || c < 0x20 || c == 0x7f; };
  std::replace_if(name.begin(), name.end(), no_part_of_names, '_');
  return name;
}

}  // namespace graupel::experiments
