// OpenVDB point grids, one file a frame: P, v, id, type, material, J. The only file of this folder that knows OpenVDB.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>

#include "core/system/archive_file.h"
#include "core/system/error.h"
#include "io/export/export_frames.h"

// The library holds these classes with all their virtual functions, which need not be compiled again.
extern template class openvdb::tree::Tree<openvdb::points::PointDataTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::tools::PointIndexTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::BoolTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Int32Tree::RootNodeType>;
extern template class openvdb::Grid<openvdb::points::PointDataGrid::TreeType>;
extern template class openvdb::Grid<openvdb::tools::PointIndexTree>;
extern template class openvdb::Grid<openvdb::BoolTree>;
extern template class openvdb::Grid<openvdb::Int32Tree>;

namespace graupel::io {

namespace {

using openvdb::points::PointDataGrid;
using openvdb::tools::PointIndexGrid;

/// Adds an attribute with one value a particle.
template <typename T>
void add_attribute(PointDataGrid& grid, const PointIndexGrid& index, const std::string& name,
                   const std::vector<T>& values) {
  const openvdb::points::PointAttributeVector<T> wrapped(values);
  openvdb::points::appendAttribute<T>(grid.tree(), name);
  openvdb::points::populateAttribute<PointDataGrid::TreeType, PointIndexGrid::TreeType,
                                     openvdb::points::PointAttributeVector<T>>(grid.tree(), index.tree(), name,
                                                                               wrapped);
}

std::vector<openvdb::Vec3s> vdb_vectors(const std::vector<Vec3f>& values) {
  std::vector<openvdb::Vec3s> out;
  out.reserve(values.size());
  for (const Vec3f& v : values) out.emplace_back(v[0], v[1], v[2]);
  return out;
}

PointDataGrid::Ptr point_grid(const PointFrame& frame) {
  const std::vector<openvdb::Vec3s> positions = vdb_vectors(frame.position);
  const openvdb::points::PointAttributeVector<openvdb::Vec3s> wrapped(positions);
  constexpr int points_per_voxel = 8;
  const float voxel = openvdb::points::computeVoxelSize(wrapped, points_per_voxel);
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  const auto index = openvdb::tools::createPointIndexGrid<PointIndexGrid>(wrapped, *transform);
  auto grid =
      openvdb::points::createPointDataGrid<openvdb::points::NullCodec, PointDataGrid>(*index, wrapped, *transform);
  add_attribute(*grid, *index, "id", frame.id);
  add_attribute(*grid, *index, "type", frame.particle_type);
  if (!frame.materials.empty()) add_attribute(*grid, *index, "material", frame.materials.index);
  if (!frame.velocity.empty()) add_attribute(*grid, *index, "v", vdb_vectors(frame.velocity));
  if (!frame.volume_ratio.empty()) add_attribute(*grid, *index, "J", frame.volume_ratio);
  grid->setName("particles");
  grid->insertMeta("time", openvdb::DoubleMetadata(frame.time));
  return grid;
}

class VdbPoints : public PointWriter {
 public:
  explicit VdbPoints(const ExportTarget& target) : target_(target) {
    prepare_export(target);
    openvdb::initialize();
  }
  void write(int64_t frame, const PointFrame& points) override {
    const std::string path = frame_file(target_, frame, ".vdb");
    check_finite(frame, points);  // OpenVDB sorts points into voxels: a NaN has none
    const PointDataGrid::Ptr grid = point_grid(points);
    write_archive<openvdb::io::Archive>(path, openvdb::GridCPtrVec{grid});
  }

 private:
  ExportTarget target_;
};

}  // namespace

std::unique_ptr<PointWriter> make_vdb_points(const ExportTarget& target) { return std::make_unique<VdbPoints>(target); }

}  // namespace graupel::io
