// What a name stands for, before a file of it is read. None of these throws std::filesystem_error, whatever the name.
#pragma once

#include <string>

namespace graupel::experiments {

bool is_there(const std::string& path);
bool is_folder(const std::string& path);

/// Throws InputError where `path` is not there, or there and not to be read: no permission, a loop of links, a name
/// that is too long. Readers of HDF5 take such files for damaged.
void check_readable(const std::string& path);

}  // namespace graupel::experiments
