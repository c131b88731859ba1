// Frames in a folder that another export left there under the names of this one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace graupel::experiments {

/// Files <name>_0007<ending> of `folder`, and with `of_materials` <name>_<material>_0007<ending>, whose number is not
/// among the ascending `frames`; sorted.
std::vector<std::string> other_frames(const std::string& folder, const std::string& name, bool of_materials,
                                      const std::string& ending, const std::vector<int64_t>& frames);

}  // namespace graupel::experiments
