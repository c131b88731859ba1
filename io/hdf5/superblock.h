// The first bytes of an HDF5 file, version 0 as Graupel writes them: where the file says that it ends. HDF5 opens no
// file that is shorter.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace graupel::io::hdf5 {

/// Empty for a file that begins otherwise.
std::optional<uint64_t> stated_end(const std::string& path);
/// Lets such a file say that it ends at `end`; what lies behind is an error of the library. Throws Failure.
void state_end(const std::string& path, uint64_t end);

}  // namespace graupel::io::hdf5
