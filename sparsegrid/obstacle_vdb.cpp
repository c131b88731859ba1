// Level sets by OpenVDB: sampled from formulas, from closed meshes and from .vdb files; converted to NanoVDB; written,
// read and inspected. The only file of this folder that includes OpenVDB (nvcc cannot read it, and it is slow to
// parse).
#include <nanovdb/util/NanoToOpenVDB.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetRebuild.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <mutex>

#include "core/parallel/device.h"
#include "core/parallel/parallel_for.h"
#include "core/system/archive_file.h"
#include "core/system/checks/file_check.h"
#include "core/system/error.h"
#include "sparsegrid/level_set_grid.h"
#include "sparsegrid/obstacle_checks.h"

// The library holds these classes with all their virtual functions, which need not be compiled again.
extern template class openvdb::tree::Tree<openvdb::FloatTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::DoubleTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Vec3STree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::BoolTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Int32Tree::RootNodeType>;
extern template class openvdb::Grid<openvdb::FloatTree>;
extern template class openvdb::Grid<openvdb::DoubleTree>;
extern template class openvdb::Grid<openvdb::Vec3STree>;
extern template class openvdb::Grid<openvdb::BoolTree>;
extern template class openvdb::Grid<openvdb::Int32Tree>;

namespace graupel::sparsegrid {

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr int block = Leaf::DIM;
constexpr int64_t max_blocks = int64_t(1) << 24;  ///< 2 KiB each: 32 GiB when all are in the band
constexpr int64_t max_voxels = int64_t(1) << 28;  ///< of a file that is read
constexpr int64_t voxels_per_byte = 64;           ///< of a file; a leaf has 4, and there are tiles
constexpr int64_t max_extent = int64_t(1) << 21;  ///< voxels along an axis of a file that is read

constexpr float spare_voxels = 2;  ///< OpenVDB's distances err at the border of the band it is asked for

void initialize_openvdb() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Delayed loading maps the file and reads it at first use, out of reach of the checks made here.
    setenv("OPENVDB_DISABLE_DELAYED_LOAD", "1", 1);
    openvdb::initialize();
  });
}

Vec3i to_vec(const Coord& c) { return {c.x(), c.y(), c.z()}; }

/// Exception text that came from a file: bounded, printable.
std::string tame(const std::string& text) {
  std::string out = text.substr(0, 200);
  std::replace_if(
      out.begin(), out.end(), [](unsigned char c) { return c < 32; }, ' ');
  return out;
}

FloatGrid::Ptr empty_level_set(double voxel, double band) {
  auto grid = FloatGrid::create(static_cast<float>(band));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

/// Origins of the 8^3 blocks that meet the box, in index space.
template <typename Visitor>
void for_each_block(const LocalBox& box, double voxel, Visitor&& visit) {
  Vec3i first, last;
  int64_t count = 1;
  for (int d = 0; d < 3; ++d) {
    const double low = std::floor(box.low[d] / voxel / block), high = std::floor(box.high[d] / voxel / block);
    count = high - low < 1e6 ? count * (static_cast<int64_t>(high - low) + 1) : max_blocks + 1;
    if (count > max_blocks)
      throw ConfigError("an obstacle needs too many blocks of its grid (voxel " + std::to_string(voxel) +
                        " m, at most 2^24 blocks of 8^3 voxels). Choose a larger obstacle_voxel or a smaller obstacle");
    first[d] = static_cast<int>(low), last[d] = static_cast<int>(high);
  }
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i) visit(Coord(i * block, j * block, k * block));
}

/// Values of the leaves from `distance`, active where |distance| < band.
void fill_leaves(const std::vector<Leaf*>& leaves, const DistanceFunction& distance, double voxel, double band) {
  const auto fill_leaf = [&](int64_t number) {
    Leaf& leaf = *leaves[static_cast<std::size_t>(number)];
    for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
      const Coord c = leaf.offsetToGlobalCoord(n);
      const double phi = distance(Vec3d{c.x() * voxel, c.y() * voxel, c.z() * voxel});
      if (std::abs(phi) < band)
        leaf.setValueOn(n, static_cast<float>(phi));
      else
        leaf.setValueOff(n, static_cast<float>(std::copysign(band, phi)));
    }
  };
  parallel_for_cpu(static_cast<int64_t>(leaves.size()), fill_leaf, Grain{16});
}

/// Level set of an exact distance: a block whose centre is farther from the surface than the band and half its own
/// diagonal holds one value.
FloatGrid::Ptr sampled_level_set(const DistanceFunction& distance, LocalBox box, double voxel, double band) {
  auto grid = empty_level_set(voxel, band);
  const double reach = band + voxel * block * 0.5 * std::sqrt(3.0);
  box.low -= Vec3d::filled(band + voxel);
  box.high += Vec3d::filled(band + voxel);
  std::vector<Leaf*> leaves;
  for_each_block(box, voxel, [&](const Coord& origin) {
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

FloatGrid::Ptr mesh_level_set(const Obstacle& obstacle, const std::string& name, double voxel, double band) {
  check_mesh(obstacle, name);
  const float width = static_cast<float>(band / voxel) + spare_voxels;
  check_level_set_size(name, "the mesh '" + obstacle.file + "'", size_of(*obstacle.mesh), voxel,
                       static_cast<double>(width));
  std::vector<openvdb::Vec3d> points;
  for (const Vec3d& v : obstacle.mesh->vertices) points.emplace_back(v[0] / voxel, v[1] / voxel, v[2] / voxel);
  std::vector<openvdb::Vec3I> triangles;
  for (const auto& t : obstacle.mesh->triangles) triangles.emplace_back(t[0], t[1], t[2]);
  const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3d, openvdb::Vec3I> adapter(points, triangles);
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  return openvdb::tools::meshToVolume<FloatGrid>(adapter, *transform, width, width);
}

/// Runs `body` and turns what OpenVDB throws about a file into an InputError.
template <typename Body>
auto reading(const std::string& path, Body&& body) {
  check_file(path, FileFormat::vdb);
  initialize_openvdb();
  try {
    return body();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError("'" + path + "' cannot be read as OpenVDB (" + tame(e.what()) + "). Check the file");
  }
}

/// Throws InputError when the stated size of a grid is beyond what is read here.
void check_size(const openvdb::GridBase& grid, const std::string& path) {
  const auto voxels = grid.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT);
  const auto low = grid.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MIN);
  const auto high = grid.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MAX);
  bool fits = !voxels || (voxels->value() >= 0 && voxels->value() <= max_voxels);
  for (int d = 0; d < 3 && low && high; ++d)
    fits =
        fits && std::abs(int64_t(low->value()[d])) <= max_extent && std::abs(int64_t(high->value()[d])) <= max_extent;
  if (!fits)
    throw InputError("'" + path + "': grid '" + tame(grid.getName()) +
                     "' is too large (at most 2^28 active voxels, coordinates within 2^21). Resample it");
}

/// Throws InputError where the grid has more voxels than the file's bytes justify: active tiles.
void check_bytes(const openvdb::GridBase& grid, const std::string& path) {
  std::error_code code;
  const auto bytes = static_cast<int64_t>(std::filesystem::file_size(path, code));
  const auto voxels = static_cast<int64_t>(grid.activeVoxelCount());
  if (!code && voxels > (int64_t(1) << 20) && voxels / voxels_per_byte > bytes)
    throw InputError("'" + path + "': grid '" + tame(grid.getName()) + "' has " + std::to_string(voxels) +
                     " active voxels in " + std::to_string(bytes) +
                     " bytes (it is filled, no narrow band). Make it a level set with a narrow band");
}

/// The first level set of floats in the file.
FloatGrid::Ptr read_level_set(const std::string& path) {
  return reading(path, [&] {
    openvdb::io::File file(path);
    file.open(/*delayLoad=*/false);
    for (auto name = file.beginName(); name != file.endName(); ++name) {
      const auto header = file.readGridMetadata(*name);
      if (!header || !header->isType<FloatGrid>() || header->getGridClass() != openvdb::GRID_LEVEL_SET) continue;
      check_size(*header, path);
      const auto grid = openvdb::gridPtrCast<FloatGrid>(file.readGrid(*name));
      if (!grid || grid->empty() || static_cast<int64_t>(grid->activeVoxelCount()) > max_voxels) continue;
      check_bytes(*grid, path);
      if (!grid->hasUniformVoxels() || !(grid->voxelSize()[0] > 0))
        throw InputError("'" + path + "': grid '" + tame(*name) + "' has voxels that are not cubes. Resample it");
      for (auto value = grid->cbeginValueOn(); value; ++value)
        if (!std::isfinite(*value))
          throw InputError("'" + path + "': grid '" + tame(*name) +
                           "' holds a value that is not finite. Check the file");
      return grid;
    }
    throw InputError("'" + path + "' holds no usable level set (a float grid of class 'level set' is needed)." +
                     " Convert a fog volume to a level set first");
  });
}

/// Whether voxel (i,j,k) of the grid lies at (i,j,k) * voxel.
bool is_plain(const openvdb::math::Transform& transform, double voxel) {
  bool plain = true;
  for (const openvdb::Vec3d& index : {openvdb::Vec3d(0, 0, 0), openvdb::Vec3d(1e3, 0, 0), openvdb::Vec3d(0, 1e3, 1e3)})
    plain = plain && (transform.indexToWorld(index) - index * voxel).length() < 1e-2 * voxel;
  return plain;
}

/// Whether neighbouring values differ as distances do (some programs store level sets that are none).
bool has_slopes_of_a_distance(const FloatGrid& grid, double voxel) {
  const auto accessor = grid.getConstAccessor();
  const double limit = steepest_grid * voxel;
  for (auto value = grid.cbeginValueOn(); value; ++value)
    for (int d = 0; d < 3; ++d)
      for (int side = -1; side <= 1; side += 2) {
        Coord next = value.getCoord();
        next[d] += side;
        if (std::abs(accessor.getValue(next) - *value) > limit) return false;
      }
  return true;
}

/// The surface between voxels of different sign. Each of its pieces of a voxel's size is crossed by 1.5 edges of the
/// grid, in the mean over all directions.
SurfaceSize surface_of(const FloatGrid& grid) {
  const auto accessor = grid.getConstAccessor();
  const double voxel = grid.voxelSize()[0];
  int64_t crossings = 0;
  for (auto value = grid.cbeginValueOn(); value; ++value)
    for (int d = 0; d < 3; ++d) {
      Coord next = value.getCoord();
      next[d] += 1;
      crossings += (*value < 0) != (accessor.getValue(next) < 0) ? 1 : 0;
    }
  const auto box = grid.evalActiveVoxelBoundingBox();
  const auto world = grid.transform().indexToWorld(openvdb::BBoxd(box.min().asVec3d(), box.max().asVec3d()));
  SurfaceSize size = {static_cast<double>(crossings) / 1.5 * voxel * voxel, 0};
  for (int d = 0; d < 3; ++d) size.extent = std::max({size.extent, std::abs(world.min()[d]), std::abs(world.max()[d])});
  return size;
}

/// The file's level set at the wanted voxel and band: kept where it has them, else rebuilt from its zero surface.
FloatGrid::Ptr file_level_set(const Obstacle& obstacle, const std::string& name, double voxel, double band) {
  return reading(obstacle.file, [&] {
    auto grid = read_level_set(obstacle.file);
    grid->tree().voxelizeActiveTiles();
    const float scale = static_cast<float>(obstacle.scale);
    for (auto value = grid->beginValueAll(); value; ++value) value.setValue(*value * scale);
    grid->tree().root().setBackground(grid->background() * scale, /*updateChildNodes=*/false);
    grid->transform().postScale(obstacle.scale);
    openvdb::tools::signedFloodFill(grid->tree());
    if (is_plain(grid->transform(), voxel) && grid->background() >= band * (1 - 1e-5) &&
        has_slopes_of_a_distance(*grid, voxel)) {
      grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
      return grid;
    }
    const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
    const float width = static_cast<float>(band / voxel) + spare_voxels;
    check_level_set_size(name, "the level set of '" + obstacle.file + "'", surface_of(*grid), voxel,
                         static_cast<double>(width));
    return openvdb::tools::levelSetRebuild(*grid, 0.0f, width, width, transform.get());
  });
}

/// Box of the voxels with a negative value, in voxels.
openvdb::CoordBBox negative_box(const FloatGrid& grid) {
  openvdb::CoordBBox box;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueAll(); value; ++value)
      if (*value < 0) box.expand(value.getCoord());
  auto tile = grid.tree().cbeginValueAll();
  tile.setMaxDepth(FloatGrid::TreeType::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile)
    if (*tile < 0) box.expand(tile.getBoundingBox());
  return box;
}

LocalBox padded(const openvdb::CoordBBox& box, double voxel) {
  if (box.empty()) return {Vec3d::filled(1e30), Vec3d::filled(-1e30)};
  return {to_vec(box.min().offsetBy(-1)).cast<double>() * voxel, to_vec(box.max().offsetBy(1)).cast<double>() * voxel};
}

template <typename GridType>
void value_facts(const GridType& grid, GridFacts& facts) {
  facts.background = static_cast<double>(grid.background());
  bool first = true;
  for (auto value = grid.cbeginValueOn(); value; ++value, first = false) {
    const double v = static_cast<double>(*value);
    facts.min_value = first ? v : std::min(facts.min_value, v);
    facts.max_value = first ? v : std::max(facts.max_value, v);
  }
}

GridFacts facts_of(const openvdb::GridBase& grid) {
  GridFacts facts;
  facts.name = tame(grid.getName());
  facts.grid_class = openvdb::GridBase::gridClassToString(grid.getGridClass());
  facts.voxel = grid.voxelSize()[0];
  facts.active_voxels = static_cast<int64_t>(grid.activeVoxelCount());
  facts.bytes = static_cast<int64_t>(grid.memUsage());
  const auto box = grid.evalActiveVoxelBoundingBox();
  facts.index_low = to_vec(box.min());
  facts.index_high = to_vec(box.max());
  if (!box.empty()) {
    const auto world = grid.transform().indexToWorld(openvdb::BBoxd(box.min().asVec3d(), box.max().asVec3d()));
    facts.world_low = {world.min()[0], world.min()[1], world.min()[2]};
    facts.world_high = {world.max()[0], world.max()[1], world.max()[2]};
  }
  if (const auto* floats = dynamic_cast<const FloatGrid*>(&grid)) value_facts(*floats, facts);
  if (const auto* doubles = dynamic_cast<const openvdb::DoubleGrid*>(&grid)) value_facts(*doubles, facts);
  return facts;
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
  grid->setName("obstacles");
  std::vector<Leaf*> leaves;
  for (const LocalBox& box : request.boxes)
    for_each_block(box, request.voxel, [&](const Coord& origin) {
      if (!grid->tree().probeLeaf(origin)) leaves.push_back(grid->tree().touchLeaf(origin));
    });
  fill_leaves(leaves, request.distance, request.voxel, request.band);
  openvdb::tools::pruneLevelSet(grid->tree());
  return grid;
}

LevelSetGrid level_set_of(const Scene& scene, const Obstacle& obstacle, const std::string& name) {
  const double voxel = scene.voxel(), band = scene.band();
  FloatGrid::Ptr grid;
  if (obstacle.shape == Shape::mesh) {
    grid = mesh_level_set(obstacle, name, voxel, band);
  } else if (obstacle.shape == Shape::vdb) {
    grid = file_level_set(obstacle, name, voxel, band);
  } else {
    const LocalBox box =
        obstacle.shape == Shape::plane ? plane_bounds(obstacle, scene.domain) : analytic_bounds(obstacle);
    grid = sampled_level_set([&](const Vec3d& x) { return analytic_distance(obstacle, x); }, box, voxel, band);
  }
  clamp_to_band(*grid, band);
  openvdb::tools::pruneInactive(grid->tree());
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

}  // namespace

LevelSetGrid build_level_set(const Scene& scene, const Obstacle& obstacle, const std::string& name) {
  initialize_openvdb();
  // OpenVDB would use all cores, also for each of many obstacles that are built at once.
  tbb::task_arena arena(num_threads());
  return arena.execute([&] { return level_set_of(scene, obstacle, name); });
}

void write_level_sets(const std::string& path, const std::vector<const LevelSetGrid*>& grids,
                      const UnionRequest& union_request) {
  initialize_openvdb();
  openvdb::GridPtrVec out;
  for (const LevelSetGrid* one : grids) {
    out.push_back(nanovdb::nanoToOpenVDB(*one->grid()));
    out.back()->setName(one->facts.name);
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

std::vector<GridFacts> inspect_vdb(const std::string& path) {
  return reading(path, [&] {
    std::vector<GridFacts> all;
    openvdb::io::File file(path);
    file.open(/*delayLoad=*/false);
    for (auto name = file.beginName(); name != file.endName(); ++name) {
      check_size(*file.readGridMetadata(*name), path);
      all.push_back(facts_of(*file.readGrid(*name)));
    }
    return all;
  });
}

}  // namespace graupel::sparsegrid
