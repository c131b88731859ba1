// Goes before all else of files that use OpenVDB: its small functions are compiled with them. OpenVDB's library, made by
// g++, does not export these, and clang++ -O1 does not inline them.
#pragma once

#include <openvdb/version.h>
#undef OPENVDB_USE_EXPLICIT_INSTANTIATION
