// How HDF5 files are written: a driver of the library that does not tell it of failed writes. HDF5 1.10 crashes in
// H5Ocopy, and when it closes the file, where a write fails. So the driver remembers the first failure, drops all later
// writes, and the writer asks. Space is taken from the end of the file as it is asked for, without blocks set aside:
// so the bytes do not depend on when the file was flushed. Metadata wait for the end of a flush, and are written in an
// order in which no part of the file refers to one that is not there yet: a kill between two writes costs nothing that
// was flushed before.
#pragma once

#include "io/hdf5/hdf5.h"

namespace graupel::io::hdf5 {

/// Files created with these access properties are written by this driver.
void use_output_driver(hid_t access);

/// Throws Failure, with the system's words, where a write to this open file of create_file() has failed.
void check_written(hid_t file);

/// Closes a file of create_file(); throws Failure where a write to it has failed.
void close_written(Handle& file);

}  // namespace graupel::io::hdf5
