// A scene's pictures and curves in the report.
#pragma once

#include <string>
#include <vector>

#include "compare/comparison.h"

namespace graupel::compare {

/// Strips of pictures at the same frames, the truth first; a note where they were left out.
std::string scene_pictures(const SceneResult& scene, const std::vector<std::string>& models);
/// Errors and energy over the frames, with the noise floors as grey areas and dotted lines for models outside their
/// training; forces on obstacles and walls where they are known.
std::string scene_plots(const SceneResult& scene, const std::vector<std::string>& models);

}  // namespace graupel::compare
