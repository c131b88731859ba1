// Triangles are joined along edges (union-find); a part lies in another one where that winds around its
// vertices, which lines in z tell.
#include "sparsegrid/mesh/mesh_parts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "sparsegrid/mesh/line_crossing.h"
#include "sparsegrid/mesh/mesh_topology.h"

namespace graupel::sparsegrid {

namespace {

constexpr std::size_t trial_vertices = 8;  ///< of a part, at most, that must lie in another one

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

/// A vertex of a part, and the winding numbers of the other parts around it.
struct Trial {
  Vec3d x;
  std::size_t part;
  std::map<std::size_t, int> winding;
};

std::vector<Trial> trials_of(const TriangleMesh& mesh, const std::vector<MeshPart>& parts,
                             const std::vector<std::size_t>& closed) {
  std::vector<Trial> trials;
  for (const std::size_t p : closed) {
    const auto& triangles = parts[p].triangles;
    const std::size_t step = (triangles.size() + trial_vertices - 1) / trial_vertices;
    for (std::size_t i = 0; i < triangles.size(); i += step) trials.push_back({corner(mesh, triangles[i], 0), p, {}});
  }
  return trials;
}

/// Trials in cells of the (x, y) plane.
class TrialCells {
 public:
  explicit TrialCells(std::vector<Trial>& trials) : trials_(trials) {
    count_ = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(trials.size()))), 1, 1024);
    for (const Trial& t : trials)
      for (int d = 0; d < 2; ++d) low_[d] = std::min(low_[d], t.x[d]), high_[d] = std::max(high_[d], t.x[d]);
    cells_.resize(static_cast<std::size_t>(count_) * static_cast<std::size_t>(count_));
    for (std::size_t i = 0; i < trials.size(); ++i)
      cell(place(0, trials[i].x[0]), place(1, trials[i].x[1])).push_back(i);
  }

  /// visit(trial) of all trials in the cells that the box meets.
  template <typename Visit>
  void visit(const Vec3d& low, const Vec3d& high, const Visit& visit) {
    for (int i = place(0, low[0]); i <= place(0, high[0]); ++i)
      for (int j = place(1, low[1]); j <= place(1, high[1]); ++j)
        for (const std::size_t t : cell(i, j)) visit(trials_[t]);
  }

 private:
  int place(int d, double x) const {
    const double share = (x - low_[d]) / (high_[d] - low_[d]) * count_;
    return static_cast<int>(std::min(std::max(0.0, share), count_ - 1.0));
  }
  std::vector<std::size_t>& cell(int i, int j) { return cells_[static_cast<std::size_t>(i * count_ + j)]; }

  std::vector<Trial>& trials_;
  double low_[2] = {1e300, 1e300}, high_[2] = {-1e300, -1e300};
  int count_;
  std::vector<std::vector<std::size_t>> cells_;
};

/// Follows the line from below to each trial through all parts.
void wind(const TriangleMesh& mesh, const std::vector<MeshPart>& parts, const std::vector<std::size_t>& closed,
          std::vector<Trial>& trials) {
  TrialCells cells(trials);
  for (const std::size_t p : closed)
    for (const int32_t t : parts[p].triangles) {
      const Vec3d &a = corner(mesh, t, 0), &b = corner(mesh, t, 1), &c = corner(mesh, t, 2);
      Vec3d low, high;
      for (int d = 0; d < 3; ++d) low[d] = std::min({a[d], b[d], c[d]}), high[d] = std::max({a[d], b[d], c[d]});
      cells.visit(low, high, [&](Trial& trial) {
        if (trial.part == p || trial.x[2] <= low[2]) return;
        const auto hit = crossing(a, b, c, trial.x[0], trial.x[1]);
        if (hit && hit->z < trial.x[2]) trial.winding[p] += hit->turn;
      });
    }
}

/// From the largest part to the smallest, each after those around it: all its trials lie in these.
void set_levels(const TriangleMesh& mesh, const std::vector<std::size_t>& closed, std::vector<MeshPart>& parts) {
  std::vector<Trial> trials = trials_of(mesh, parts, closed);
  wind(mesh, parts, closed, trials);
  std::vector<std::map<std::size_t, int>> around(parts.size());  // of how many trials
  std::vector<int> count(parts.size(), 0);
  for (const Trial& trial : trials) {
    ++count[trial.part];
    for (const auto& [p, turns] : trial.winding) around[trial.part][p] += turns != 0 ? 1 : 0;
  }
  const auto size = [&](std::size_t p) { return std::abs(parts[p].volume); };
  std::vector<std::size_t> order = closed;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return size(a) > size(b); });
  for (const std::size_t inner : order) {
    const MeshPart* nearest = nullptr;
    for (const auto& [p, inside] : around[inner])
      if (inside == count[inner] && size(p) > size(inner) && (!nearest || size(p) < std::abs(nearest->volume)))
        nearest = &parts[p];
    if (nearest) parts[inner].level = nearest->level + (parts[inner].volume * nearest->volume < 0 ? 1 : 0);
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
