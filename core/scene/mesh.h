// Triangle mesh as read from OBJ, PLY or STL.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel {

struct TriangleMesh {
  std::vector<Vec3d> vertices;                    ///< [m], in the file's frame times the scene's scale
  std::vector<std::array<int32_t, 3>> triangles;  ///< counter-clockwise seen from outside
};

}  // namespace graupel
