// The files of experiments/viewer/page, which the program holds.
#pragma once

#include <string_view>
#include <vector>

namespace graupel::experiments {

struct PageFile {
  const char* route;  ///< below the secret word; "" is the page itself
  const char* type;
  std::string_view text;
};

const std::vector<PageFile>& page_files();

}  // namespace graupel::experiments
