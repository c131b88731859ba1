// What the page gets beside the frames: facts of the runs as JSON, types and obstacles as bytes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "experiments/viewer/frame_source.h"

namespace graupel::experiments {

using Sources = std::vector<std::shared_ptr<FrameSource>>;

/// Names, times, box, materials with their colours.
std::string facts_json(const Sources& sides);
/// Number of the run, frames that are there, state.
std::string status_json(const Sources& sides);
/// u8 [particles]: the particles' types; 255 where they are more.
std::string type_bytes(const RunFacts& facts);
/// u32 obstacles; of each u32 corners, i32 its place among those that move or -1; then all corners (SurfaceCorner).
std::string obstacle_bytes(const RunFacts& facts);

}  // namespace graupel::experiments
