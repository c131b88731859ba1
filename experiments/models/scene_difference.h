// What tells two scenes of one sweep apart: the runs of a sweep differ in its parameters, and in names, seeds and
// steps.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

namespace graupel::experiments {

/// A key in which two scenes differ, as a JSON pointer ("/gravity/1"), and both values as text; "nothing" for none.
struct SceneDifference {
  std::string key, own, other;
};

/// The first key in which scene `own` differs from `other`, apart from those that the runs of a sweep may have
/// otherwise (names, seed, frames, frame time, fixed steps), the dotted `parameter_keys` and the pointers `also`. Both
/// are JSON as io::scene_to_json writes it.
std::optional<SceneDifference> scene_difference(const std::string& own, const std::string& other,
                                                const std::vector<std::string>& parameter_keys,
                                                const std::set<std::string>& also = {});

/// "gravity.1" as "/gravity/1".
std::string pointer_of(std::string dotted_key);

/// The number at a dotted key of a scene. Throws ConfigError where there is none; `file` is what varies it.
double number_at(const std::string& scene_json, const std::string& dotted_key, const std::string& file);

}  // namespace graupel::experiments
