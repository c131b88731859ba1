// Whether a .vdb file is laid out as OpenVDB writes grids of numbers, without OpenVDB, whose library alone loads in ten
// times as long as such a file is read.
#pragma once

#include <string_view>

namespace graupel::sparsegrid {

/// Whether the library comes through the file of these bytes: every count, length and place in it is what a writer of
/// OpenVDB 5 to 11 (formats 222 to 224) puts there, all is expanded once, and a tree of its nodes stays far below what
/// a file of that size may take (core/system/checks/file_check.cpp). False for all else, also for good files of other
/// kinds: points, masks, instances, frustums.
bool is_plain_vdb(std::string_view file);

}  // namespace graupel::sparsegrid
