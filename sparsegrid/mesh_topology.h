// Whether a triangle mesh bounds a volume.
#pragma once

#include "core/scene/mesh.h"

namespace graupel::sparsegrid {

/// Edges that belong to an odd number of triangles; 0 for a closed mesh. Vertices at the same place count as one
/// (STL repeats them); triangles without area are skipped.
int64_t open_edges(const TriangleMesh& mesh);

}  // namespace graupel::sparsegrid
