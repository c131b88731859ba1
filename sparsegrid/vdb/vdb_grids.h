// Grids of OpenVDB between the sources of this folder that include it: from .vdb files (vdb_file.cpp) to level sets of
// obstacles (obstacle_vdb.cpp). nvcc cannot read OpenVDB, and it is slow to parse.
#pragma once

#include <openvdb/openvdb.h>

#include <string>

#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

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

inline constexpr float spare_voxels = 2;  ///< OpenVDB's distances err at the border of the band it is asked for

inline Vec3i to_vec(const openvdb::Coord& c) { return {c.x(), c.y(), c.z()}; }

/// Before any other use of OpenVDB.
void initialize_openvdb();

/// The level set of the obstacle's file at the wanted voxel and band [m]: kept where it has them, else rebuilt from its
/// zero surface. Throws InputError for a file without a usable one, ConfigError where it is too large or too small.
openvdb::FloatGrid::Ptr file_level_set(const Obstacle& obstacle, const std::string& name, double voxel, double band);

/// Level sets of a closed mesh [own frame] and of the zero surface of `grid`, with `width` voxels on each side and
/// without what lies in cavities.
openvdb::FloatGrid::Ptr mesh_level_set(const TriangleMesh& mesh, double voxel, float width);
openvdb::FloatGrid::Ptr rebuilt_level_set(const openvdb::FloatGrid& grid, double voxel, float width);

GridFacts facts_of(const openvdb::GridBase& grid);

}  // namespace graupel::sparsegrid
