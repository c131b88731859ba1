// The content of a file as JSON: a scene, a sweep, a trajectory, a saved state, weights or .vdb grids.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace graupel::experiments {

/// {"kind": ..}, by the file's ending. Throws ConfigError for an unknown ending, InputError for a damaged file.
nlohmann::ordered_json file_facts(const std::string& file);

}  // namespace graupel::experiments
