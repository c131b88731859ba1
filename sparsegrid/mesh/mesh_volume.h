// Volume of the region that a mesh bounds.
#pragma once

#include "core/scene/mesh.h"

namespace graupel::sparsegrid {

/// [m^3] of the region that its level set has as the inside: parts united, cavities left out (mesh_parts.h). Exact
/// where parts do not overlap; else what they share is measured along 256 x 256 lines.
double mesh_volume(const TriangleMesh& mesh);

}  // namespace graupel::sparsegrid
