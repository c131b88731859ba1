// Splits of LagrangeBench data sets: train.h5, valid.h5, test.h5. A group a trajectory, 00000, 00001, ..., with
// position [T, N, dim] and particle_type [N].
#pragma once

#include <memory>
#include <string>

#include "io/particle_series.h"

namespace graupel::io {

/// Throws InputError for a file that is damaged or of another kind; links to other files and plugins are refused.
std::unique_ptr<SeriesReader> open_lagrangebench_split(const std::string& file);

/// Positions f32, deflated; types i32. LagrangeBench reads one number of frames from a split: all trajectories must
/// have it (InputError). Throws IoError; what is at `file` then is of no use.
void write_lagrangebench_split(const std::string& file, int64_t count, const SeriesSource& source);

}  // namespace graupel::io
