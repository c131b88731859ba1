// Splits of data sets for the graph network simulator of geoelements/gns: train.npz, valid.npz, test.npz. A zip archive
// of .npy members, which are pickled arrays of Python objects: (positions [T, N, dim], particle types [N]) or
// (positions, particle types, material property [N]) of each trajectory.
#pragma once

#include <memory>
#include <string>

#include "io/particle_series.h"

namespace graupel::io {

/// Reads the two layouts there are: a member a trajectory, in the archive's order, whatever its name; or all in one
/// member called gns_data. Types and material property may be one number for all particles. Nothing is executed: what
/// arrays of numbers do not need is refused. Throws InputError with file, member and what was found.
std::unique_ptr<SeriesReader> open_gns_split(const std::string& file);

/// Writes a member "simulation_trajectory_<i>" a trajectory: an array of 2 or 3 objects, which NumPy reads with
/// allow_pickle. Positions f32, types i64, material property f32. One trajectory is in memory at a time.
void write_gns_split(const std::string& file, int64_t count, const SeriesSource& source);

}  // namespace graupel::io
