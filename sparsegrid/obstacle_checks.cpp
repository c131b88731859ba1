#include "sparsegrid/obstacle_checks.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "core/system/error.h"
#include "sparsegrid/analytic_shape.h"
#include "sparsegrid/mesh/mesh_topology.h"

namespace graupel::sparsegrid {

namespace {

constexpr double most_voxels = 1 << 26;         ///< in the band of a level set
constexpr double largest_coordinate = 1 << 21;  ///< [voxels]
constexpr double block = 8;                     ///< voxels along an edge of a leaf
constexpr double leaf_bytes = 2144;             ///< of NanoVDB, floats
constexpr double tree_bytes = 2.2e6;            ///< of the upper nodes: eight meet at the origin of a body

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// Leaves that hold the band around a surface: it is as thick as the band and a leaf. Of a small body they are those of
/// its box.
double leaves_of(const LocalBox& box, double area, double voxel, double band) {
  const double edge = block * voxel;
  double whole = 1;
  for (int d = 0; d < 3; ++d) whole *= (box.high[d] - box.low[d] + 2 * band) / edge + 1;
  return std::min(whole, area * (2 * band + edge) / (edge * edge * edge) + 8);
}

/// A convex body has at most the area of its box.
double area_of(const LocalBox& box) {
  const Vec3d s = box.high - box.low;
  return 2 * (s[0] * s[1] + s[1] * s[2] + s[2] * s[0]);
}

LocalBox box_of(const TriangleMesh& mesh) {
  LocalBox box = {Vec3d::filled(1e300), Vec3d::filled(-1e300)};
  for (const Vec3d& v : mesh.vertices)
    for (int d = 0; d < 3; ++d) {
      box.low[d] = std::min(box.low[d], v[d]);
      box.high[d] = std::max(box.high[d], v[d]);
    }
  return box;
}

/// Nothing where the grid alone is too large, which is refused by the obstacle's name.
double bytes_of(const Obstacle& obstacle, double voxel, double band) {
  const bool is_mesh = obstacle.shape == Shape::mesh && obstacle.mesh && !obstacle.mesh->vertices.empty();
  if (!is_mesh && (!is_analytic(obstacle.shape) || obstacle.shape == Shape::plane)) return 0;
  const LocalBox box = is_mesh ? box_of(*obstacle.mesh) : analytic_bounds(obstacle);
  const double area = is_mesh ? size_of(*obstacle.mesh).area : area_of(box);
  const double leaves = leaves_of(box, area, voxel, band);
  return leaves * block * block <= most_voxels ? tree_bytes + leaf_bytes * leaves : 0;
}

}  // namespace

std::string mesh_words(const Obstacle& obstacle) {
  return obstacle.file.empty() ? "the mesh" : "the mesh '" + obstacle.file + "'";
}

void check_mesh(const Obstacle& obstacle, const std::string& name) {
  if (!obstacle.mesh || obstacle.mesh->triangles.empty())
    throw InputError(name + ": " + mesh_words(obstacle) + " has no triangles. Give a closed surface");
  const MeshFaults faults = faults_of(*obstacle.mesh);
  const auto refuse = [&](const std::string& what, const char* remedy) {
    char place[96];
    std::snprintf(place, sizeof place, "(%.4g, %.4g, %.4g) m", faults.place[0], faults.place[1], faults.place[2]);
    throw InputError(name + ": " + mesh_words(obstacle) + " " + what + ", the first near " + place + "). " + remedy);
  };
  if (faults.open_edges > 0)
    refuse("is not closed (" + std::to_string(faults.open_edges) + " open edges",
           "Fill its holes, so that it has an inside");
  if (faults.misdirected_edges > 0)
    refuse("has triangles that face inwards beside others that face outwards (" +
               std::to_string(faults.misdirected_edges) + " edges between them",
           "Let all face outwards (in Blender: Mesh > Normals > Recalculate Outside)");
  if (faults.doubled_triangles > 0)
    refuse("has doubled faces (" + std::to_string(faults.doubled_triangles) + " triangles",
           "Keep one of each (in Blender: Mesh > Merge > By Distance)");
}

SurfaceSize size_of(const TriangleMesh& mesh) {
  SurfaceSize size;
  for (const Vec3d& v : mesh.vertices)
    for (int d = 0; d < 3; ++d) size.extent = std::max(size.extent, std::abs(v[d]));
  for (const auto& t : mesh.triangles) {
    const Vec3d& a = mesh.vertices[static_cast<std::size_t>(t[0])];
    const Vec3d ab = mesh.vertices[static_cast<std::size_t>(t[1])] - a,
                ac = mesh.vertices[static_cast<std::size_t>(t[2])] - a;
    size.area += 0.5 * norm(cross(ab, ac));
  }
  return size;
}

void check_level_set_size(const std::string& name, const std::string& what, const SurfaceSize& surface, double voxel,
                          double width) {
  const double voxels = surface.area / (voxel * voxel) * (2 * width + 1);
  if (!(voxels <= most_voxels) || !(surface.extent / voxel <= largest_coordinate))
    throw ConfigError(name + ": " + what + " is too large for its grid (about " + short_number(voxels / 1e6) +
                      " million voxels of " + short_number(voxel) +
                      " m, at most 67 million, coordinates within 2^21 of them). Choose a larger obstacle_voxel, a "
                      "smaller obstacle_band or another scale");
}

double grid_bytes(const Scene& scene) {
  double bytes = 0;
  std::set<ShapeKey> known;  // equal bodies share a grid
  for (const Obstacle& obstacle : scene.obstacles)
    if (!is_analytic(obstacle.shape) || known.insert(shape_key(obstacle)).second)
      bytes += bytes_of(obstacle, scene.voxel(), scene.band());
  return bytes;
}

void check_grids_fit(const Scene& scene, double available) {
  const double needed = grid_bytes(scene);
  if (needed <= available) return;
  char text[96];
  std::snprintf(text, sizeof text, "about %.3g GB needed, %.3g GB available", 1e-9 * needed, 1e-9 * available);
  throw ConfigError("the level sets of " + std::to_string(scene.obstacles.size()) +
                    " obstacles do not fit into the memory (" + text +
                    "). Choose a larger obstacle_voxel, a narrower obstacle_band or fewer obstacles");
}

}  // namespace graupel::sparsegrid
