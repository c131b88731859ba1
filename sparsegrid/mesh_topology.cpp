// Counts the triangles of each edge after merging vertices of equal position.
#include "sparsegrid/mesh_topology.h"

#include <algorithm>
#include <numeric>

namespace graupel::sparsegrid {

namespace {

/// Index of the first vertex at the same place, for every vertex.
std::vector<int32_t> merged_vertices(const std::vector<Vec3d>& vertices) {
  const auto less = [&](int32_t a, int32_t b) {
    return std::lexicographical_compare(vertices[a].a, vertices[a].a + 3, vertices[b].a, vertices[b].a + 3);
  };
  std::vector<int32_t> order(vertices.size()), merged(vertices.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), less);
  for (std::size_t i = 0; i < order.size(); ++i)
    merged[order[i]] = i > 0 && vertices[order[i]] == vertices[order[i - 1]] ? merged[order[i - 1]] : order[i];
  return merged;
}

}  // namespace

int64_t open_edges(const TriangleMesh& mesh) {
  const std::vector<int32_t> merged = merged_vertices(mesh.vertices);
  std::vector<std::pair<int32_t, int32_t>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    const int32_t v[3] = {merged[triangle[0]], merged[triangle[1]], merged[triangle[2]]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    for (int e = 0; e < 3; ++e) edges.push_back(std::minmax(v[e], v[(e + 1) % 3]));
  }
  std::sort(edges.begin(), edges.end());
  int64_t open = 0;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    open += (end - i) % 2;
    i = end;
  }
  return open;
}

}  // namespace graupel::sparsegrid
