// Datasets of particle fields in a trajectory: [frame, particle, component], or [frame, particle] for single numbers.
#pragma once

#include <map>

#include "core/scene/particle_fields.h"
#include "io/hdf5/hdf5_dataset.h"

namespace graupel::io {

/// Size of one frame of a field.
std::vector<hsize_t> field_row(ParticleField field, hsize_t particles);

/// The fields that a trajectory's group holds; throws hdf5::Failure where one does not fit its `particles`.
std::map<ParticleField, hdf5::Dataset> open_field_datasets(hid_t group, hsize_t particles, uint64_t file_size);

/// Reads one frame of a field.
void read_field_row(const hdf5::Dataset& dataset, ParticleField field, hsize_t row, ParticleFields& fields);

}  // namespace graupel::io
