// Triangles are joined along edges (union-find); a part lies in another one where that winds around its vertices.
#include "sparsegrid/mesh/mesh_parts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sparsegrid/mesh/mesh_topology.h"

namespace graupel::sparsegrid {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr std::size_t trial_vertices = 8;  ///< of a part, that must lie in another one

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int32_t root(int32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The lower root stays.
  void join(int32_t a, int32_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int32_t> parent_;
};

struct TriangleEdge {
  int32_t low, high, triangle;
  bool operator<(const TriangleEdge& other) const { return std::pair(low, high) < std::pair(other.low, other.high); }
};

/// The first triangle of each triangle's part, -1 without area; `open` are those parts with an edge of an odd number of
/// triangles.
std::vector<int32_t> joined_triangles(const TriangleMesh& mesh, std::vector<uint8_t>& open) {
  const std::vector<int32_t> merged = merged_vertices(mesh.vertices);
  std::vector<int32_t> first(mesh.triangles.size());
  std::vector<TriangleEdge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    int32_t v[3];
    for (int i = 0; i < 3; ++i) v[i] = merged[static_cast<std::size_t>(mesh.triangles[t][i])];
    first[t] = v[0] == v[1] || v[1] == v[2] || v[2] == v[0] ? -1 : 0;
    for (int i = 0; i < 3 && first[t] == 0; ++i)
      edges.push_back({std::min(v[i], v[(i + 1) % 3]), std::max(v[i], v[(i + 1) % 3]), static_cast<int32_t>(t)});
  }
  std::sort(edges.begin(), edges.end());
  DisjointSets sets(mesh.triangles.size());
  std::vector<int32_t> odd;
  for (std::size_t i = 0, end; i < edges.size(); i = end) {
    for (end = i + 1; end < edges.size() && !(edges[i] < edges[end]); ++end)
      sets.join(edges[i].triangle, edges[end].triangle);
    if ((end - i) % 2 != 0) odd.push_back(edges[i].triangle);
  }
  for (std::size_t t = 0; t < first.size(); ++t)
    if (first[t] == 0) first[t] = sets.root(static_cast<int32_t>(t));
  open.assign(first.size(), 0);
  for (const int32_t t : odd) open[static_cast<std::size_t>(sets.root(t))] = 1;
  return first;
}

const Vec3d& corner(const TriangleMesh& mesh, int32_t triangle, int i) {
  return mesh.vertices[static_cast<std::size_t>(mesh.triangles[static_cast<std::size_t>(triangle)][i])];
}

/// Sum of the solid angles of the triangles seen from x, over 4 pi (Van Oosterom and Strackee 1983).
double winding_number(const TriangleMesh& mesh, const MeshPart& part, const Vec3d& x) {
  double sum = 0;
  for (const int32_t t : part.triangles) {
    const Vec3d a = corner(mesh, t, 0) - x, b = corner(mesh, t, 1) - x, c = corner(mesh, t, 2) - x;
    const double la = norm(a), lb = norm(b), lc = norm(c);
    sum += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return sum / (4 * pi);
}

bool lies_in(const TriangleMesh& mesh, const MeshPart& inner, const MeshPart& outer) {
  for (int d = 0; d < 3; ++d)
    if (!(inner.box.low[d] >= outer.box.low[d] && inner.box.high[d] <= outer.box.high[d])) return false;
  const std::size_t step = std::max<std::size_t>(1, inner.triangles.size() / trial_vertices);
  for (std::size_t i = 0; i < inner.triangles.size(); i += step)
    if (std::abs(winding_number(mesh, outer, corner(mesh, inner.triangles[i], 0))) < 0.5) return false;
  return true;
}

/// From the largest part to the smallest, each after what may be around it.
void set_levels(const TriangleMesh& mesh, const std::vector<std::size_t>& closed, std::vector<MeshPart>& parts) {
  std::vector<std::size_t> order = closed;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return std::abs(parts[a].volume) > std::abs(parts[b].volume); });
  for (std::size_t i = 1; i < order.size(); ++i)
    for (std::size_t j = i; j-- > 0;) {  // the smallest one around it comes first
      MeshPart& inner = parts[order[i]];
      const MeshPart& outer = parts[order[j]];
      if (!lies_in(mesh, inner, outer)) continue;
      inner.level = outer.level + (inner.volume * outer.volume < 0 ? 1 : 0);
      break;
    }
}

}  // namespace

double six_volumes(const TriangleMesh& mesh, std::size_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return dot(mesh.vertices[static_cast<std::size_t>(a)],
             cross(mesh.vertices[static_cast<std::size_t>(b)], mesh.vertices[static_cast<std::size_t>(c)]));
}

std::vector<MeshPart> parts_of(const TriangleMesh& mesh) {
  std::vector<uint8_t> open;
  const std::vector<int32_t> first = joined_triangles(mesh, open);
  std::vector<int32_t> number(first.size(), -1);
  std::vector<MeshPart> parts;
  std::vector<std::size_t> closed;
  for (std::size_t t = 0; t < first.size(); ++t) {
    if (first[t] < 0) continue;
    int32_t& own = number[static_cast<std::size_t>(first[t])];
    if (own < 0) {
      own = static_cast<int32_t>(parts.size());
      if (!open[static_cast<std::size_t>(first[t])]) closed.push_back(parts.size());
      parts.push_back({{}, {Vec3d::filled(1e300), Vec3d::filled(-1e300)}});
    }
    MeshPart& part = parts[static_cast<std::size_t>(own)];
    part.triangles.push_back(static_cast<int32_t>(t));
    part.volume += six_volumes(mesh, t) / 6;
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) {
        const double x = corner(mesh, static_cast<int32_t>(t), i)[d];
        part.box.low[d] = std::min(part.box.low[d], x);
        part.box.high[d] = std::max(part.box.high[d], x);
      }
  }
  std::erase_if(closed, [&](std::size_t i) { return !std::isfinite(parts[i].volume); });
  const auto faces_inwards = [&](std::size_t i) { return parts[i].volume < 0; };
  const auto inwards = std::count_if(closed.begin(), closed.end(), faces_inwards);
  if (inwards > 0 && inwards < static_cast<std::ptrdiff_t>(closed.size())) set_levels(mesh, closed, parts);
  return parts;
}

}  // namespace graupel::sparsegrid
