// Parameters of a run as attributes of its trajectory: parameter_names, parameter_units, parameter_values,
// parameter_keys (those of a parameter joined by spaces).
#pragma once

#include "io/hdf5/hdf5.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::io {

void write_parameters(hid_t group, const std::vector<NamedValue>& values);
/// Empty when there are none. Throws hdf5::Failure when the attributes do not belong together.
std::vector<NamedValue> read_parameters(hid_t group);
/// Whether write_parameters() writes an attribute of this name.
bool is_parameter_attribute(const std::string& name);

}  // namespace graupel::io
