// The parsers behind read_mesh and read_points, one file format each; `name` stands for the file in messages.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/scene/mesh.h"

namespace graupel::io {

/// The text of a file without UTF-8's byte order mark; mesh_fail()s for text in another encoding, by its mark.
std::string_view mesh_text(const std::string& bytes, const std::string& name);
[[noreturn]] void mesh_fail(const std::string& name, const std::string& problem);

TriangleMesh parse_obj(const std::string& bytes, const std::string& name);
/// ASCII and binary little-endian; polygons are split into fans. Without faces: vertices only.
TriangleMesh parse_ply(const std::string& bytes, const std::string& name);
/// ASCII and binary; vertices at exactly the same place become one.
TriangleMesh parse_stl(const std::string& bytes, const std::string& name);

}  // namespace graupel::io
