// Whether a triangle mesh bounds a volume.
#pragma once

#include "core/scene/mesh.h"

namespace graupel::sparsegrid {

/// What keeps a mesh from bounding a volume once; all 0 for a good one. Vertices at the same place count as one (STL
/// repeats them); triangles without area are skipped.
struct MeshFaults {
  int64_t open_edges = 0;         ///< they belong to an odd number of triangles
  int64_t misdirected_edges = 0;  ///< their triangles do not run along them equally often in both directions
  int64_t doubled_triangles = 0;  ///< more than one has these vertices
  Vec3d place;                    ///< of the first of the faults that are named first
};

/// Index of the first vertex at the same place, for every vertex.
std::vector<int32_t> merged_vertices(const std::vector<Vec3d>& vertices);

MeshFaults faults_of(const TriangleMesh& mesh);

}  // namespace graupel::sparsegrid
