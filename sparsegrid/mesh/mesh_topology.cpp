// Counts the triangles along each edge, with their direction, after merging vertices of equal position.
#include "sparsegrid/mesh/mesh_topology.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace graupel::sparsegrid {

namespace {

/// An edge between merged vertices, the lower one first.
struct Edge {
  int32_t low, high;
  bool runs_up;  ///< as its triangle runs along it
  bool operator<(const Edge& other) const { return std::pair(low, high) < std::pair(other.low, other.high); }
};

using Triple = std::array<int32_t, 3>;

void count_edges(std::vector<Edge> edges, const std::vector<Vec3d>& vertices, MeshFaults& faults) {
  std::sort(edges.begin(), edges.end());
  Vec3d open{}, misdirected{};
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i, up = 0;
    for (; end < edges.size() && !(edges[i] < edges[end]); ++end) up += edges[end].runs_up ? 1 : 0;
    const bool is_open = (end - i) % 2 != 0, is_misdirected = !is_open && 2 * up != end - i;
    const Vec3d middle = (vertices[edges[i].low] + vertices[edges[i].high]) * 0.5;
    if (is_open && faults.open_edges++ == 0) open = middle;
    if (is_misdirected && faults.misdirected_edges++ == 0) misdirected = middle;
    i = end;
  }
  faults.place = faults.open_edges > 0 ? open : misdirected;
}

void count_doubled(std::vector<Triple> triangles, const std::vector<Vec3d>& vertices, MeshFaults& faults) {
  std::sort(triangles.begin(), triangles.end());
  for (std::size_t i = 1; i < triangles.size(); ++i) {
    if (triangles[i] != triangles[i - 1]) continue;
    if (faults.doubled_triangles++ > 0 || faults.open_edges > 0 || faults.misdirected_edges > 0) continue;
    const auto [a, b, c] = triangles[i];
    faults.place = (vertices[a] + vertices[b] + vertices[c]) * (1.0 / 3);
  }
}

}  // namespace

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

MeshFaults faults_of(const TriangleMesh& mesh) {
  const std::vector<int32_t> merged = merged_vertices(mesh.vertices);
  std::vector<Edge> edges;
  std::vector<Triple> triangles;
  edges.reserve(3 * mesh.triangles.size());
  triangles.reserve(mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    Triple v = {merged[triangle[0]], merged[triangle[1]], merged[triangle[2]]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    for (int e = 0; e < 3; ++e) {
      const int32_t from = v[e], to = v[(e + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), from < to});
    }
    std::sort(v.begin(), v.end());
    triangles.push_back(v);
  }
  MeshFaults faults;
  count_edges(std::move(edges), mesh.vertices, faults);
  count_doubled(std::move(triangles), mesh.vertices, faults);
  return faults;
}

}  // namespace graupel::sparsegrid
