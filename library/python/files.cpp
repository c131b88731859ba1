#include "library/python/files.h"

#include "io/trajectory/input_files.h"

namespace graupel::python {

std::string path_of(nb::handle path) {
  const nb::bytes encoded(nb::module_::import_("os").attr("fsencode")(path));
  std::string file(encoded.c_str(), encoded.size());
  if (file.empty()) throw ConfigError("a path is empty. Name a file");
  if (file.find('\0') != std::string::npos)
    throw ConfigError("the path '" + file.substr(0, file.find('\0')) + "' goes on after a null byte. Give another");
  return file;
}

nb::str text_of(const std::string& text) {
  return nb::steal<nb::str>(PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace"));
}

std::vector<NamedFile> files_of(const PyScene& scene) {
  std::vector<NamedFile> files = {{"the scene", scene.file}};
  const auto add = [&](const auto& bodies) {
    for (const Body& body : bodies) files.push_back({"the geometry", body.file});
  };
  add(scene.obstacles);
  add(scene.sources);
  add(scene.emitters);
  return files;
}

void check_output(const std::string& file, const std::vector<NamedFile>& inputs) {
  check_library_output(file);
  io::check_inputs_kept(inputs, {{"the output", file}});
}

}  // namespace graupel::python
