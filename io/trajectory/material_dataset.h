// Which material of the scene each particle of a trajectory is of: `material` i32 [n], places in the attribute
// `material_names` of the group, -1 for particles of obstacles. Only where two materials are of one law.
#pragma once

#include <vector>

#include "core/scene/trajectory.h"
#include "io/hdf5/hdf5_dataset.h"

namespace graupel::io {

/// Nothing for empty ones. Throws hdf5::Failure.
void write_materials(hid_t group, const ParticleMaterials& materials);

/// Empty where the group has none. `is_whole`: the file says that it is. Throws hdf5::Failure where the dataset does
/// not fit the names, or the particles by their types [n].
ParticleMaterials read_materials(hid_t group, const std::vector<int32_t>& particle_type, uint64_t file_size,
                                 bool is_whole);

}  // namespace graupel::io
