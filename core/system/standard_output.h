// Standard output: whose it is, and whether all of it has arrived.
#pragma once

namespace graupel {

/// Opens those of the descriptors 0 to 2 that are closed (">&-"), so that no file of the run takes their number: to
/// print is an error of writing then. Call it before any file is opened.
void open_closed_streams();
/// From now on all that is printed goes to standard error; standard output is that of write_file_atomically("-") alone,
/// so that a program can read it. Call it before anything is printed.
void reserve_standard_output();
/// The descriptor of standard output, also where it is reserved.
int standard_output();
/// Hands on what was printed; throws IoError where that fails, as on a full disk.
void flush_standard_output();

}  // namespace graupel
