// Level sets of closed surfaces: triangle meshes, and the zero surfaces of other level sets. OpenVDB takes as outside
// what it reaches from outside, so that it fills cavities; they are cut out level by level (mesh_parts.h).
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>

#include "sparsegrid/mesh/mesh_parts.h"
#include "sparsegrid/vdb/vdb_grids.h"

/// OpenVDB's library lacks this one of its members, and gcc 13 does not inline it beside a sanitizer's checks.
template void openvdb::tree::Tree<openvdb::BoolTree::RootNodeType>::merge(openvdb::BoolTree&, openvdb::MergePolicy);

namespace graupel::sparsegrid {

namespace {

using openvdb::FloatGrid;
namespace tools = openvdb::tools;

/// Points in index space; triangles, or quadrilaterals and triangles.
template <typename Point, typename Polygon>
struct Surface {
  std::vector<Point> points;
  std::vector<Polygon> polygons;
};

template <typename Point, typename Polygon>
FloatGrid::Ptr filled_level_set(const Surface<Point, Polygon>& surface, double voxel, float width, int flags) {
  const tools::QuadAndTriangleDataAdapter<Point, Polygon> adapter(surface.points, surface.polygons);
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  return tools::meshToVolume<FloatGrid>(adapter, *transform, width, width, flags);
}

/// `level[i]` is that of polygon i.
template <typename Point, typename Polygon>
FloatGrid::Ptr level_set_of(const Surface<Point, Polygon>& surface, const std::vector<int>& level, double voxel,
                            float width, int flags) {
  const int last = level.empty() ? 0 : *std::max_element(level.begin(), level.end());
  if (last == 0) return filled_level_set(surface, voxel, width, flags);
  FloatGrid::Ptr whole;
  for (int l = 0; l <= last; ++l) {
    Surface<Point, Polygon> part = {surface.points, {}};
    for (std::size_t i = 0; i < level.size(); ++i)
      if (level[i] == l) part.polygons.push_back(surface.polygons[i]);
    const FloatGrid::Ptr grid = filled_level_set(part, voxel, width, flags);
    if (!whole)
      whole = grid;
    else if (l % 2 == 0)
      tools::csgUnion(*whole, *grid);
    else
      tools::csgDifference(*whole, *grid);
  }
  return whole;
}

std::vector<int> levels_of(const TriangleMesh& mesh) {
  std::vector<int> level(mesh.triangles.size(), 0);
  for (const MeshPart& part : parts_of(mesh))
    for (const int32_t t : part.triangles) level[static_cast<std::size_t>(t)] = part.level;
  return level;
}

std::vector<int> levels_of(const Surface<openvdb::Vec3s, openvdb::Vec4I>& surface) {
  TriangleMesh mesh;
  for (const auto& p : surface.points) mesh.vertices.push_back(Vec3d{p[0], p[1], p[2]});
  std::vector<std::size_t> polygon;
  for (std::size_t i = 0; i < surface.polygons.size(); ++i) {
    const openvdb::Vec4I& q = surface.polygons[i];
    const auto add = [&](int a, int b, int c) {
      mesh.triangles.push_back({static_cast<int32_t>(q[a]), static_cast<int32_t>(q[b]), static_cast<int32_t>(q[c])});
      polygon.push_back(i);
    };
    add(0, 1, 2);
    if (q[3] != openvdb::util::INVALID_IDX) add(0, 2, 3);
  }
  const std::vector<int> of_triangle = levels_of(mesh);
  std::vector<int> level(surface.polygons.size(), 0);
  for (std::size_t t = 0; t < polygon.size(); ++t) level[polygon[t]] = std::max(level[polygon[t]], of_triangle[t]);
  return level;
}

}  // namespace

FloatGrid::Ptr mesh_level_set(const TriangleMesh& mesh, double voxel, float width) {
  Surface<openvdb::Vec3d, openvdb::Vec3I> surface;
  for (const Vec3d& v : mesh.vertices) surface.points.emplace_back(v[0] / voxel, v[1] / voxel, v[2] / voxel);
  for (const auto& t : mesh.triangles) surface.polygons.emplace_back(t[0], t[1], t[2]);
  return level_set_of(surface, levels_of(mesh), voxel, width, 0);
}

FloatGrid::Ptr rebuilt_level_set(const FloatGrid& grid, double voxel, float width) {
  tools::VolumeToMesh mesher(0.0);
  mesher(grid);
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  Surface<openvdb::Vec3s, openvdb::Vec4I> surface;
  for (std::size_t i = 0; i < mesher.pointListSize(); ++i)
    surface.points.emplace_back(transform->worldToIndex(mesher.pointList()[i]));
  for (std::size_t i = 0; i < mesher.polygonPoolListSize(); ++i) {
    const tools::PolygonPool& pool = mesher.polygonPoolList()[i];
    for (std::size_t q = 0; q < pool.numQuads(); ++q) surface.polygons.push_back(pool.quad(q));
    for (std::size_t t = 0; t < pool.numTriangles(); ++t) {
      const openvdb::Vec3I& v = pool.triangle(t);
      surface.polygons.emplace_back(v[0], v[1], v[2], openvdb::util::INVALID_IDX);
    }
  }
  return level_set_of(surface, levels_of(surface), voxel, width, tools::DISABLE_RENORMALIZATION);
}

}  // namespace graupel::sparsegrid
