// Level sets of obstacles by OpenVDB: sampled from formulas, from closed meshes and from .vdb files (vdb_file.cpp);
// converted to NanoVDB and written.
#include <nanovdb/util/NanoToOpenVDB.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Archive.h>
#include <openvdb/tools/Prune.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "core/parallel/device.h"
#include "core/parallel/parallel_for.h"
#include "core/system/archive_file.h"
#include "core/system/error.h"
#include "sparsegrid/level_set_grid.h"
#include "sparsegrid/obstacle_checks.h"
#include "sparsegrid/vdb/vdb_grids.h"

namespace graupel::sparsegrid {

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr int block = Leaf::DIM;
constexpr int64_t max_blocks = int64_t(1) << 24;  ///< 2 KiB each: 32 GiB when all are in the band

FloatGrid::Ptr empty_level_set(double voxel, double band) {
  auto grid = FloatGrid::create(static_cast<float>(band));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

/// Origins of the 8^3 blocks that meet the box, in index space; `name` is whose grid it is.
template <typename Visitor>
void for_each_block(const std::string& name, const LocalBox& box, double voxel, Visitor&& visit) {
  Vec3i first, last;
  int64_t count = 1;
  for (int d = 0; d < 3; ++d) {
    const double low = std::floor(box.low[d] / voxel / block), high = std::floor(box.high[d] / voxel / block);
    count = high - low < 1e6 ? count * (static_cast<int64_t>(high - low) + 1) : max_blocks + 1;
    if (count > max_blocks)
      throw ConfigError(name + " needs too many blocks of its grid (voxel " + std::to_string(voxel) +
                        " m, at most 2^24 blocks of 8^3 voxels). Choose a larger obstacle_voxel or a smaller obstacle");
    first[d] = static_cast<int>(low), last[d] = static_cast<int>(high);
  }
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i) visit(Coord(i * block, j * block, k * block));
}

/// Values of the leaves from `distance`, active where |distance| < band.
void fill_leaves(const std::vector<Leaf*>& leaves, const DistanceFunction& distance, double voxel, double band) {
  const auto limit = static_cast<float>(band);
  const auto fill_leaf = [&](int64_t number) {
    Leaf& leaf = *leaves[static_cast<std::size_t>(number)];
    for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
      const Coord c = leaf.offsetToGlobalCoord(n);
      const auto phi = static_cast<float>(distance(Vec3d{c.x() * voxel, c.y() * voxel, c.z() * voxel}));
      if (std::abs(phi) < limit)
        leaf.setValueOn(n, phi);
      else
        leaf.setValueOff(n, std::copysign(limit, phi));
    }
  };
  parallel_for_cpu(static_cast<int64_t>(leaves.size()), fill_leaf, Grain{16});
}

/// Farthest centre of a block that meets the band.
double reach_of(double voxel, double band) { return band + voxel * block * 0.5 * std::sqrt(3.0); }

/// Level set of an exact distance, +-band outside the band: a block whose centre is farther from the surface than the
/// band and half its own diagonal holds one value.
FloatGrid::Ptr sampled_level_set(const std::string& name, const DistanceFunction& distance, LocalBox box, double voxel,
                                 double band) {
  auto grid = empty_level_set(voxel, band);
  const double reach = reach_of(voxel, band);
  box.low -= Vec3d::filled(band + voxel);
  box.high += Vec3d::filled(band + voxel);
  std::vector<Leaf*> leaves;
  for_each_block(name, box, voxel, [&](const Coord& origin) {
    const double half = (block - 1) / 2.0;
    const double centre = distance(Vec3d{origin.x() + half, origin.y() + half, origin.z() + half} * voxel);
    if (centre < -reach)
      grid->tree().addTile(1, origin, static_cast<float>(-band), false);
    else if (centre < reach)
      leaves.push_back(grid->tree().touchLeaf(origin));
  });
  fill_leaves(leaves, distance, voxel, band);
  return grid;
}

/// Values beyond the band and inactive ones become exactly +-band, inactive.
void clamp_to_band(FloatGrid& grid, double band) {
  const float limit = static_cast<float>(band);
  auto& tree = grid.tree();
  for (auto leaf = tree.beginLeaf(); leaf; ++leaf)
    for (auto value = leaf->beginValueAll(); value; ++value)
      if (!value.isValueOn() || std::abs(*value) >= limit) {
        value.setValue(std::copysign(limit, *value));
        value.setValueOff();
      }
  auto tile = tree.beginValueAll();
  tile.setMaxDepth(FloatGrid::TreeType::ValueAllIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    tile.setValue(std::copysign(limit, *tile));
    tile.setActiveState(false);
  }
  tree.root().setBackground(limit, /*updateChildNodes=*/false);
}

FloatGrid::Ptr checked_level_set(const Obstacle& obstacle, const std::string& name, double voxel, double band) {
  check_mesh(obstacle, name);
  const float width = static_cast<float>(band / voxel) + spare_voxels;
  check_level_set_size(name, mesh_words(obstacle), size_of(*obstacle.mesh), voxel, static_cast<double>(width));
  return mesh_level_set(*obstacle.mesh, voxel, width);
}

/// Adds the negative values of a node and all below it. An upper node has 32,768 entries, and eight of them meet at a
/// body's origin: OpenVDB's iterators over their tiles take longer than all else about a small body.
template <typename Node>
void add_negative(const Node& node, openvdb::CoordBBox& box) {
  if constexpr (Node::LEVEL == 0) {
    for (openvdb::Index n = 0; n < Node::SIZE; ++n)
      if (node.getValue(n) < 0) box.expand(node.offsetToGlobalCoord(n));
  } else {
    for (openvdb::Index n = 0; n < Node::NUM_VALUES; ++n)
      if (!node.getChildMask().isOn(n) && node.getTable()[n].getValue() < 0)
        box.expand(openvdb::CoordBBox::createCube(node.offsetToGlobalCoord(n), Node::ChildNodeType::DIM));
    for (auto child = node.cbeginChildOn(); child; ++child) add_negative(*child, box);
  }
}

/// Box of the voxels with a negative value, in voxels.
openvdb::CoordBBox negative_box(const FloatGrid& grid) {
  openvdb::CoordBBox box;
  const auto& root = grid.tree().root();
  for (auto child = root.cbeginChildOn(); child; ++child) add_negative(*child, box);
  for (auto tile = root.cbeginValueAll(); tile; ++tile)
    if (*tile < 0) box.expand(openvdb::CoordBBox::createCube(tile.getCoord(), root.getChildDim()));
  return box;
}

LocalBox padded(const openvdb::CoordBBox& box, double voxel) {
  if (box.empty()) return {Vec3d::filled(1e30), Vec3d::filled(-1e30)};
  return {to_vec(box.min().offsetBy(-1)).cast<double>() * voxel, to_vec(box.max().offsetBy(1)).cast<double>() * voxel};
}

template <typename GridType>
Buffer<char> to_nano(const GridType& grid) {
  const auto handle = nanovdb::openToNanoVDB(grid, nanovdb::StatsMode::MinMax, nanovdb::ChecksumMode::Disable);
  Buffer<char> bytes(Device::cpu, handle.size());
  std::copy_n(reinterpret_cast<const char*>(handle.data()), handle.size(), bytes.data());
  return bytes;
}

void write_grids(const std::string& path, const openvdb::GridPtrVec& grids) {
  write_archive<openvdb::io::Archive>(path, openvdb::GridCPtrVec(grids.begin(), grids.end()));
}

FloatGrid::Ptr union_level_set(const UnionRequest& request) {
  auto grid = empty_level_set(request.voxel, request.band);
  const std::string name = "obstacles";
  grid->setName(name);
  std::vector<Leaf*> leaves;
  for (const LocalBox& box : request.boxes)
    for_each_block(name, box, request.voxel, [&](const Coord& origin) {
      if (!grid->tree().probeLeaf(origin)) leaves.push_back(grid->tree().touchLeaf(origin));
    });
  // Beyond the bands of bodies a block has one value, but at the border of the insides.
  const double half = (block - 1) / 2.0 * request.voxel, reach = reach_of(request.voxel, request.band);
  const auto add_inside = [&](const Coord& origin) {
    const Vec3d centre = to_vec(origin).cast<double>() * request.voxel + Vec3d::filled(half);
    const double depth = box_distance(*request.border, centre);
    if (depth >= reach || grid->tree().probeLeaf(origin) || request.distance(centre) >= 0) return;
    if (depth <= -reach)
      grid->tree().addTile(1, origin, static_cast<float>(-request.band), false);
    else
      leaves.push_back(grid->tree().touchLeaf(origin));
  };
  for (const LocalBox& box : request.insides) for_each_block(name, box, request.voxel, add_inside);
  DistanceFunction distance = request.distance;
  if (request.border)
    distance = [&](const Vec3d& x) { return std::max(request.distance(x), box_distance(*request.border, x)); };
  fill_leaves(leaves, distance, request.voxel, request.band);
  openvdb::tools::pruneLevelSet(grid->tree());
  return grid;
}

/// `grid` is +-band outside its band.
LevelSetGrid finished(const FloatGrid::Ptr& grid, const std::string& name, double voxel) {
  openvdb::tools::pruneLevelSet(grid->tree());  // pruneInactive() fills solids with the background, +band
  grid->setName(name);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  LevelSetGrid out;
  out.bytes = to_nano(*grid);
  out.facts = facts_of(*grid);
  out.facts.bytes = static_cast<int64_t>(out.bytes.size());
  out.near = padded(grid->evalActiveVoxelBoundingBox(), voxel);
  out.solid = padded(negative_box(*grid), voxel);
  return out;
}

LevelSetGrid level_set_of(const Scene& scene, const Obstacle& obstacle, const std::string& name) {
  const double voxel = scene.voxel(), band = scene.band();
  FloatGrid::Ptr grid;
  if (obstacle.shape == Shape::mesh) {
    grid = checked_level_set(obstacle, name, voxel, band);
    clamp_to_band(*grid, band);
  } else if (obstacle.shape == Shape::vdb) {
    grid = file_level_set(obstacle, name, voxel, band);
    clamp_to_band(*grid, band);
  } else {
    const LocalBox box =
        obstacle.shape == Shape::plane ? plane_bounds(obstacle, scene.domain) : analytic_bounds(obstacle);
    grid = sampled_level_set(
        name, [&](const Vec3d& x) { return analytic_distance(obstacle, x); }, box, voxel, band);
  }
  return finished(grid, name, voxel);
}

}  // namespace

LevelSetGrid build_level_set(const Scene& scene, const Obstacle& obstacle, const std::string& name) {
  initialize_openvdb();
  // OpenVDB would use all cores, also for each of many obstacles that are built at once.
  tbb::task_arena arena(num_threads());
  return arena.execute([&] { return level_set_of(scene, obstacle, name); });
}

LevelSetGrid build_plane_body(const Scene& scene, const Obstacle& plane, const std::string& name) {
  initialize_openvdb();
  const double voxel = scene.voxel(), band = scene.band(), margin = band + voxel;
  const LocalBox body = body_below(plane, scene.domain, margin);
  const DistanceFunction distance = [&](const Vec3d& x) { return std::max(x[1], box_distance(body, x)); };
  tbb::task_arena arena(num_threads());
  LevelSetGrid grid =
      arena.execute([&] { return finished(sampled_level_set(name, distance, body, voxel, band), name, voxel); });
  grid.near = plane_bounds(plane, scene.domain);
  grid.near.low -= Vec3d::filled(margin);
  grid.near.high += Vec3d::filled(margin);
  return grid;
}

void write_level_sets(const std::string& path, const std::vector<const LevelSetGrid*>& grids,
                      const std::vector<std::string>& names, const UnionRequest& union_request) {
  initialize_openvdb();
  openvdb::GridPtrVec out;
  for (std::size_t i = 0; i < grids.size(); ++i) {
    out.push_back(nanovdb::nanoToOpenVDB(*grids[i]->grid()));
    out.back()->setName(names[i]);
  }
  out.push_back(union_level_set(union_request));
  write_grids(path, out);
}

VectorGrid build_vector_grid(const std::vector<Vec3i>& coordinate, const std::vector<Vec3f>& value, double spacing,
                             const Vec3d& origin, const std::string& name) {
  initialize_openvdb();
  auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0));
  auto transform = openvdb::math::Transform::createLinearTransform(spacing);
  transform->postTranslate(openvdb::Vec3d(origin[0], origin[1], origin[2]) + openvdb::Vec3d(spacing / 2));
  grid->setTransform(transform);
  grid->setName(name);
  auto accessor = grid->getAccessor();
  for (std::size_t i = 0; i < coordinate.size(); ++i)
    accessor.setValue(Coord(coordinate[i].a), openvdb::Vec3s(value[i].a));
  VectorGrid out;
  out.bytes = to_nano(*grid);
  out.active_cells = static_cast<int64_t>(grid->activeVoxelCount());
  return out;
}

void write_vector_grid(const std::string& path, const VectorGrid& grid) {
  initialize_openvdb();
  write_grids(path, {nanovdb::nanoToOpenVDB(*grid.grid())});
}

}  // namespace graupel::sparsegrid
