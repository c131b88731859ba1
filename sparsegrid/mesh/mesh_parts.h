// Connected parts of a closed mesh, and which of them bound cavities.
#pragma once

#include "core/scene/mesh.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::sparsegrid {

/// Triangles that hang together by edges. A part whose triangles face the other way than those of the part around it
/// has the next level: the walls of a cavity have level 1, a body within the cavity 2, and so on. All others have that
/// of the part around them, or 0: they are united. A point is inside where the highest level around it is even.
struct MeshPart {
  std::vector<int32_t> triangles;  ///< in the mesh's order
  LocalBox box;
  double volume = 0;  ///< [m^3] by the divergence theorem: below 0 where the triangles face inwards
  int level = 0;

  bool is_solid() const { return level % 2 == 0; }
};

/// In the order of their first triangles; triangles without area belong to none.
std::vector<MeshPart> parts_of(const TriangleMesh& mesh);

/// Six times the signed volume between triangle `t` and the origin: a . (b x c) [m^3].
double six_volumes(const TriangleMesh& mesh, std::size_t t);

}  // namespace graupel::sparsegrid
