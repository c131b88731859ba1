// Triangle meshes (.obj, .ply, .stl) and point lists.
#pragma once

#include <string>
#include <vector>

#include "core/scene/mesh.h"

namespace graupel::io {

/// Throws InputError: missing file, unknown ending, damaged contents, no triangles, index out of range, non-finite
/// vertex.
TriangleMesh read_mesh(const std::string& path, double scale = 1);
/// Positions from .txt/.xyz ("x y z" a line, # comments) or .ply vertices. Throws InputError with the line.
std::vector<Vec3d> read_points(const std::string& path, double scale = 1);

}  // namespace graupel::io
