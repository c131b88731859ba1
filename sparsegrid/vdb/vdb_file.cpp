// .vdb files, which may come from anybody: read by OpenVDB, refused where they are of no use, their level sets rebuilt
// at a scene's voxel.
#include <openvdb/tools/SignedFloodFill.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <mutex>

#include "core/system/checks/file_check.h"
#include "core/system/error.h"
#include "core/system/printable.h"
#include "sparsegrid/obstacle_checks.h"
#include "sparsegrid/vdb/vdb_grids.h"

namespace graupel::sparsegrid {

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;

constexpr int64_t max_voxels = int64_t(1) << 28;  ///< of a file that is read
constexpr int64_t voxels_per_byte = 64;           ///< of a file; a leaf has 4, and there are tiles
constexpr int64_t max_extent = int64_t(1) << 21;  ///< voxels along an axis of a file that is read

/// Exception text that came from a file: bounded, printable.
std::string tame(const std::string& text) {
  std::string out = printable(text.substr(0, 200));
  std::replace(out.begin(), out.end(), '\n', ' ');
  return out;
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
  const bool is_empty = voxels && voxels->value() == 0;  // its box is turned inside out
  for (int d = 0; d < 3 && low && high && !is_empty; ++d)
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

template <typename GridType>
void value_facts(const GridType& grid, GridFacts& facts) {
  facts.holds_numbers = true;
  facts.background = static_cast<double>(grid.background());
  bool first = true;
  for (auto value = grid.cbeginValueOn(); value; ++value, first = false) {
    const double v = static_cast<double>(*value);
    facts.min_value = first ? v : std::min(facts.min_value, v);
    facts.max_value = first ? v : std::max(facts.max_value, v);
  }
}

}  // namespace

void initialize_openvdb() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Delayed loading maps the file and reads it at first use, out of reach of the checks made here.
    setenv("OPENVDB_DISABLE_DELAYED_LOAD", "1", 1);
    openvdb::initialize();
  });
}

FloatGrid::Ptr file_level_set(const Obstacle& obstacle, const std::string& name, double voxel, double band) {
  return reading(obstacle.file, [&] {
    auto grid = read_level_set(obstacle.file);
    const double scaled = grid->voxelSize()[0] * obstacle.scale;
    if (!(scaled >= smallest_voxel))
      throw ConfigError(name + ": the voxels of '" + obstacle.file + "' are too small at this scale (" +
                        std::to_string(scaled * 1e6) + "e-6 m, at least 20e-6 m). Choose a larger scale");
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
    const float width = static_cast<float>(band / voxel) + spare_voxels;
    check_level_set_size(name, "the level set of '" + obstacle.file + "'", surface_of(*grid), voxel,
                         static_cast<double>(width));
    return rebuilt_level_set(*grid, voxel, width);
  });
}

GridFacts facts_of(const openvdb::GridBase& grid) {
  GridFacts facts;
  facts.name = tame(grid.getName());
  facts.grid_class = openvdb::GridBase::gridClassToString(grid.getGridClass());
  facts.voxel = grid.voxelSize()[0];
  facts.active_voxels = static_cast<int64_t>(grid.activeVoxelCount());
  facts.bytes = static_cast<int64_t>(grid.memUsage());
  const auto box = grid.evalActiveVoxelBoundingBox();
  if (!box.empty()) {
    facts.index_low = to_vec(box.min());
    facts.index_high = to_vec(box.max());
    const auto world = grid.transform().indexToWorld(openvdb::BBoxd(box.min().asVec3d(), box.max().asVec3d()));
    facts.world_low = {world.min()[0], world.min()[1], world.min()[2]};
    facts.world_high = {world.max()[0], world.max()[1], world.max()[2]};
  }
  if (const auto* floats = dynamic_cast<const FloatGrid*>(&grid)) value_facts(*floats, facts);
  if (const auto* doubles = dynamic_cast<const openvdb::DoubleGrid*>(&grid)) value_facts(*doubles, facts);
  return facts;
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
