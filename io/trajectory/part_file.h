// The file `<path>.part` that a trajectory is written to: one writer at a time.
#pragma once

#include <cstdint>
#include <string>

#include "core/system/unfinished_file.h"
#include "io/hdf5/hdf5.h"

namespace graupel::io {

/// Creates an empty HDF5 file `part` in place of what a dead run left there. HDF5 keeps it locked until it is closed; a
/// file that another run has locked stays as it is. Throws IoError for that, and hdf5::Failure.
hdf5::Handle create_part_file(const std::string& part);

/// For a file that is filled before it replaces `part`: a name of its own, ...
std::string aside_name(const std::string& part);
/// ... and puts it in the place of `part`. Throws IoError when another run has locked that.
void replace_part_file(UnfinishedFile& aside, const std::string& part);

/// Closes the file `path`.part and gives it its final name. Throws IoError and hdf5::Failure.
void finish_part_file(hdf5::Handle& file, const std::string& path);

/// How a message on a failed write of `needed` bytes to a folder ends: "(<what the system says>). <remedy>".
std::string write_remedy(const std::string& folder, uint64_t needed, const std::string& problem);

}  // namespace graupel::io
