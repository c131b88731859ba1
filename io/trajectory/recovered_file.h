// Recovery to another place than that of the run, as where its disk is full.
#pragma once

#include <cstdint>
#include <string>

namespace graupel::io {

/// As recover_part_file(path, true), but the frames go to the finished file `destination`; where that is not `path`,
/// `path`.part stays.
int64_t recover_part_file_to(const std::string& path, const std::string& destination);

}  // namespace graupel::io
