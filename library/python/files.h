// Files that Python names: their paths, their text, and outputs that take the place of no input.
#pragma once

#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "core/system/output_files.h"
#include "library/python/binding.h"

namespace graupel::python {

/// A scene and the file that it was read from, as an absolute path; "" for none.
struct PyScene : Scene {
  std::string file;
};

/// The bytes of a str, bytes or os.PathLike; anything else is a TypeError. Throws ConfigError for a null byte.
std::string path_of(nb::handle path);
/// Text of a file as a str: bytes that are no UTF-8 become U+FFFD.
nb::str text_of(const std::string& text);

/// What a run of the scene reads: its file and its geometry.
std::vector<NamedFile> files_of(const PyScene& scene);
/// Throws IoError where `file` cannot be made, also for a folder or a device, and ConfigError where it would take the
/// place of one of `inputs` or of a file that one of them names.
void check_output(const std::string& file, const std::vector<NamedFile>& inputs);

}  // namespace graupel::python
