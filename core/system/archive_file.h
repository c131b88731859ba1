// Files of OpenVDB, written aside and renamed. Its headers stay out: the caller names its class of archives.
#pragma once

#include <fstream>
#include <string>

#include "core/system/atomic_file.h"

namespace graupel {

/// Writes grids (an openvdb::GridCPtrVec) to `path` through a stream that throws: openvdb::io::File is silent where the
/// disk is full, and the file would be cut short. `Archive`: openvdb::io::Archive. Throws IoError.
template <typename Archive, typename Grids>
void write_archive(const std::string& path, const Grids& grids) {
  struct Seekable : Archive {
    using Archive::write;  // protected there
  };
  write_part_file(path, [&](const std::string& part) {
    std::ofstream out;
    out.exceptions(std::ios::failbit | std::ios::badbit);
    out.open(part, std::ios::binary | std::ios::trunc);
    Seekable().write(out, grids, /*seekable=*/true);
    out.close();
  });
}

}  // namespace graupel
