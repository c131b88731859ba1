#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "experiments/viewer/body_mesh.h"

namespace graupel::experiments {

namespace {

constexpr double most_nodes = 1 << 24;  ///< beyond these the lattice is made coarser

/// Nodes of a lattice over a box, with the distance at each, and the vertex of each cell.
class SurfaceNet {
 public:
  SurfaceNet(const std::function<double(const Vec3d&)>& distance, const Vec3d& low, const Vec3d& high, double spacing)
      : low_(low - Vec3d::filled(spacing)), spacing_(spacing) {
    double nodes = 1;
    for (int d = 0; d < 3; ++d) nodes *= (high[d] - low[d]) / spacing + 4;
    if (nodes > most_nodes) spacing_ *= std::cbrt(nodes / most_nodes);
    for (int d = 0; d < 3; ++d) size_[d] = static_cast<int>((high[d] - low[d] + spacing) / spacing_) + 3;
    for (int k = 0; k < size_[2]; ++k)
      for (int j = 0; j < size_[1]; ++j)
        for (int i = 0; i < size_[0]; ++i) phi_.push_back(distance(place(i, j, k)));
    vertex_.assign(phi_.size(), -1);
  }

  TriangleMesh mesh() {
    for_each_cell([&](int i, int j, int k) { add_vertex(i, j, k); });
    for_each_cell([&](int i, int j, int k) { add_faces({i, j, k}); });
    return std::move(mesh_);
  }

 private:
  Vec3d place(int i, int j, int k) const { return low_ + spacing_ * Vec3d{double(i), double(j), double(k)}; }
  std::size_t index(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size_[0]) *
               (static_cast<std::size_t>(j) + static_cast<std::size_t>(size_[1]) * static_cast<std::size_t>(k));
  }
  template <typename Body>
  void for_each_cell(const Body& body) const {
    for (int k = 0; k + 1 < size_[2]; ++k)
      for (int j = 0; j + 1 < size_[1]; ++j)
        for (int i = 0; i + 1 < size_[0]; ++i) body(i, j, k);
  }

  /// The mean of the points where the surface crosses the cell's edges.
  void add_vertex(int i, int j, int k) {
    Vec3d sum = Vec3d::zero();
    int crossings = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 4; ++side) {
        std::array<int, 3> a = {i, j, k};
        a[(axis + 1) % 3] += side & 1;
        a[(axis + 2) % 3] += side >> 1;
        std::array<int, 3> b = a;
        ++b[axis];
        const double at_a = phi_[index(a[0], a[1], a[2])], at_b = phi_[index(b[0], b[1], b[2])];
        if ((at_a < 0) == (at_b < 0)) continue;
        const Vec3d start = place(a[0], a[1], a[2]);
        sum += start + (place(b[0], b[1], b[2]) - start) * (at_a / (at_a - at_b));
        ++crossings;
      }
    if (crossings == 0) return;
    vertex_[index(i, j, k)] = static_cast<int32_t>(mesh_.vertices.size());
    mesh_.vertices.push_back(sum * (1.0 / crossings));
  }

  /// Around each of the three edges at the cell's lower corner that the surface crosses: the four cells that share it.
  void add_faces(std::array<int, 3> cell) {
    const double at_cell = phi_[index(cell[0], cell[1], cell[2])];
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<int, 3> end = cell;
      ++end[axis];
      const bool inside = at_cell < 0;
      if (inside == (phi_[index(end[0], end[1], end[2])] < 0) || cell[u] == 0 || cell[v] == 0) continue;
      std::array<int32_t, 4> corner;
      for (int c = 0; c < 4; ++c) {
        std::array<int, 3> other = cell;
        other[u] -= c == 0 || c == 3;
        other[v] -= c < 2;
        corner[static_cast<std::size_t>(c)] = vertex_[index(other[0], other[1], other[2])];
      }
      if (!inside) std::swap(corner[1], corner[3]);
      mesh_.triangles.push_back({corner[0], corner[1], corner[2]});
      mesh_.triangles.push_back({corner[0], corner[2], corner[3]});
    }
  }

  Vec3d low_;
  double spacing_;
  std::array<int, 3> size_ = {};
  std::vector<double> phi_;
  std::vector<int32_t> vertex_;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh level_set_mesh(const std::function<double(const Vec3d&)>& distance, const Vec3d& low, const Vec3d& high,
                            double spacing) {
  return SurfaceNet(distance, low, high, spacing).mesh();
}

}  // namespace graupel::experiments
