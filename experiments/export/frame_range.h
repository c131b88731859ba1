// Which frames of a trajectory: FIRST:LAST:STRIDE, each part of it optional.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace graupel::experiments {

/// "10:50:2" is every second frame from 10 to 50, "10:" all from 10, ":50" those up to 50, "::5" every fifth, "7" frame
/// 7 alone, "" all. Throws ConfigError naming --frames, the part, and the frames that `where` has.
std::vector<int64_t> parse_frame_range(const std::string& text, int64_t frame_count, const std::string& where);

}  // namespace graupel::experiments
