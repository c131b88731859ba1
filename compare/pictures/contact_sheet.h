// Rows of pictures of one scene at the same frames: the truth above, predictions below.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "compare/pictures/backdrop.h"
#include "compare/pictures/image.h"

namespace graupel::compare {

/// Frames 10, 60, 150 and 300; of a run that ends before 300 those that end its quarters. Ascending, each once.
std::vector<std::size_t> picture_frames(std::size_t last);

/// One run's pictures side by side with the label and frame number in each.
Image picture_row(const Backdrop& backdrop, const ParticleRun& run, const std::vector<std::size_t>& frames,
                  const std::string& label);

/// Rows one above the other, all of the same width.
Image stack_rows(const std::vector<Image>& rows);

}  // namespace graupel::compare
