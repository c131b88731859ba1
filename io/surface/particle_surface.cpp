// Level sets and meshes of particles by OpenVDB. The only file of this folder that includes it.
#include "io/surface/particle_surface.h"

#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetFilter.h>
#include <openvdb/tools/ParticlesToLevelSet.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/tree/LeafManager.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/parallel/device.h"
#include "core/parallel/memory.h"
#include "core/parallel/parallel_for.h"
#include "core/system/archive_file.h"
#include "core/system/error.h"
#include "io/config/config_document.h"
#include "io/surface/near_particles.h"

// The library holds these classes with all their virtual functions, which need not be compiled again.
extern template class openvdb::tree::Tree<openvdb::FloatTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Vec3STree::RootNodeType>;
extern template class openvdb::Grid<openvdb::FloatTree>;
extern template class openvdb::Grid<openvdb::Vec3STree>;

namespace graupel::io {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

constexpr double most_voxels_from_origin = 1 << 24;

/// Particles as ParticlesToLevelSet reads them.
struct ParticleList {
  using PosType = openvdb::Vec3R;
  const std::vector<Vec3f>& position;
  std::size_t size() const { return position.size(); }
  void getPos(std::size_t i, openvdb::Vec3R& out) const { out = {position[i][0], position[i][1], position[i][2]}; }
};

void check_positions(const std::vector<Vec3f>& position, double voxel, const std::string& where) {
  const double most = most_voxels_from_origin * voxel;
  for (std::size_t i = 0; i < position.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(position[i][axis]) <= most))
        throw DivergedError(where + ": no surface holds particle " + std::to_string(i) + " at " +
                            number_text(position[i][axis]) + " m (allowed with this voxel size: -" + number_text(most) +
                            " to " + number_text(most) + "). Export the frames before it, or choose a larger --voxel");
}

void check_memory(const std::vector<Vec3f>& position, const SurfaceSettings& settings, const std::string& where) {
  const double bytes = surface_bytes(position, settings);
  const auto available = static_cast<double>(available_bytes(Device::cpu));
  if (bytes > available)
    throw ConfigError(where + ": a level set with voxels of " + number_text(settings.voxel) + " m needs up to " +
                      number_text(std::ceil(1e-8 * bytes) / 10) + " GB (" +
                      number_text(std::floor(1e-8 * available) / 10) + " GB are available). Choose a larger --voxel");
}

/// Adds spheres about the particles to what the grid holds.
void add_spheres(FloatGrid& grid, const std::vector<Vec3f>& position, double radius) {
  openvdb::tools::ParticlesToLevelSet<FloatGrid> spheres(grid);
  spheres.setRmin(0);
  spheres.rasterizeSpheres(ParticleList{position}, radius);
  spheres.finalize(/*prune=*/true);
}

/// Radius whose mesh has the volume of a sphere of radius `r`: vertices are averages of points on the sphere, which lie
/// 0.4 voxel^2 / r inside it (measured for radii of 0.6 to 1.2 voxels).
double drop_radius(double r, double voxel) { return 0.5 * (r + std::sqrt(r * r + 1.6 * voxel * voxel)); }

/// How far the surface moves inwards, so that it ends half a spacing from the outermost particles. Spheres about a
/// lattice reach up to h^2 / (12 r) less than their radius, on average over a face.
double inward_offset(const SurfaceSettings& s) {
  return std::max(0.0, s.radius - 0.5 * s.spacing - s.spacing * s.spacing / (12 * s.radius));
}

/// Particles of spray, which have few others near them, whose sphere of radius `drop` the surface does not hold. In a
/// body that is full of particles a corner has eight within a radius and a spacing.
std::vector<Vec3f> lost_drops(const FloatGrid& grid, const std::vector<Vec3f>& position, const NearParticles& near,
                              double drop) {
  constexpr int of_a_body = 7;                                        ///< with itself
  const FloatGrid::ConstAccessor accessor = grid.getConstAccessor();  // the sampler keeps a reference to it
  const openvdb::tools::GridSampler<FloatGrid::ConstAccessor, openvdb::tools::BoxSampler> distance(accessor,
                                                                                                   grid.transform());
  std::vector<Vec3f> drops;
  for (const Vec3f& p : position)
    if (distance.wsSample({p[0], p[1], p[2]}) > -drop && near.count(p, of_a_body) < of_a_body) drops.push_back(p);
  return drops;
}

/// Particles whose spheres touch no other, and the rest. Where the default radius moves inwards nothing of such a
/// sphere is left but what its drop covers, so that it takes no part in what comes before.
struct Spray {
  std::vector<Vec3f> alone, rest;
};
Spray split_spray(const std::vector<Vec3f>& position, const SurfaceSettings& s, double drop) {
  Spray split;
  if (s.radius - inward_offset(s) > drop) return {{}, position};
  const NearParticles touching(position, {}, 2 * (s.radius + s.voxel));
  for (const Vec3f& p : position) (touching.count(p, 2) < 2 ? split.alone : split.rest).push_back(p);
  return split;
}

/// The steps need two voxels on each side of the surface, which are a third fewer than those of the finished band.
FloatGrid::Ptr level_set_of(const std::vector<Vec3f>& position, const NearParticles& near, const SurfaceSettings& s) {
  constexpr int narrow = 2, finished = 3;  ///< half width of the band [voxels]
  const FloatGrid::Ptr grid = openvdb::createLevelSet<FloatGrid>(s.voxel, narrow);
  grid->setName("surface");
  const double drop = s.spacing * std::cbrt(0.75 / std::numbers::pi);
  const Spray spray = split_spray(position, s, drop);
  if (!spray.rest.empty()) add_spheres(*grid, spray.rest, s.radius);
  openvdb::tools::LevelSetFilter<FloatGrid> filter(*grid);
  filter.setSpatialScheme(openvdb::math::FIRST_BIAS);
  filter.normalize();
  for (int pass = 0; pass < s.smoothing; ++pass) filter.meanCurvature();
  const double inwards = inward_offset(s);
  if (inwards > 0) filter.offset(static_cast<float>(inwards));
  filter.resize(finished);
  std::vector<Vec3f> drops = lost_drops(*grid, spray.rest, near, drop);
  drops.insert(drops.end(), spray.alone.begin(), spray.alone.end());
  add_spheres(*grid, drops, drop_radius(drop, s.voxel));
  return grid;
}

/// Area-weighted means of the triangles' normals.
std::vector<Vec3f> vertex_normals(const SurfaceMesh& mesh) {
  std::vector<Vec3d> sum(mesh.position.size(), Vec3d::zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3d corner = mesh.position[a].cast<double>();
    const Vec3d normal = cross(mesh.position[b].cast<double>() - corner, mesh.position[c].cast<double>() - corner);
    for (const int32_t vertex : {a, b, c}) sum[vertex] += normal;
  }
  std::vector<Vec3f> normals;
  normals.reserve(sum.size());
  for (const Vec3d& n : sum) normals.push_back(normalized(n).cast<float>());
  return normals;
}

/// Velocities in the narrow band of the level set.
Vec3SGrid::Ptr velocity_grid(const FloatGrid& surface, const NearParticles& near) {
  const auto tree = std::make_shared<openvdb::Vec3STree>(surface.tree(), openvdb::Vec3s(0), openvdb::TopologyCopy());
  const openvdb::math::Transform& transform = surface.transform();
  openvdb::tree::LeafManager<openvdb::Vec3STree> leaves(*tree);
  leaves.foreach ([&](openvdb::Vec3STree::LeafNodeType& leaf, std::size_t) {
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
      const openvdb::Vec3d place = transform.indexToWorld(voxel.getCoord());
      const Vec3f v = near.velocity(Vec3d{place[0], place[1], place[2]}.cast<float>());
      voxel.setValue({v[0], v[1], v[2]});
    }
  });
  const Vec3SGrid::Ptr grid = Vec3SGrid::create(tree);
  grid->setTransform(transform.copy());
  grid->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
  grid->setName("v");
  return grid;
}

}  // namespace

struct ParticleSurface::Impl {
  FloatGrid::Ptr level_set;
  NearParticles near;
};

ParticleSurface::ParticleSurface(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                                 const SurfaceSettings& settings, const std::string& where) {
  check_surface_settings(settings);
  check_positions(position, settings.voxel, where);
  check_memory(position, settings, where);
  openvdb::initialize();
  // OpenVDB would use all cores.
  tbb::task_arena arena(num_threads());
  impl_ = arena.execute([&] {
    NearParticles near(position, velocity, settings.radius + settings.spacing);
    const FloatGrid::Ptr level_set = level_set_of(position, near, settings);
    return std::make_unique<Impl>(Impl{level_set, std::move(near)});
  });
}

ParticleSurface::~ParticleSurface() = default;
ParticleSurface::ParticleSurface(ParticleSurface&&) noexcept = default;

SurfaceMesh ParticleSurface::mesh() const {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  tbb::task_arena arena(num_threads());
  arena.execute([&] { openvdb::tools::volumeToMesh(*impl_->level_set, points, quads); });
  SurfaceMesh mesh;
  for (const openvdb::Vec3s& p : points) mesh.position.push_back({p[0], p[1], p[2]});
  for (const openvdb::Vec4I& quad : quads) {  // clockwise seen from outside
    const auto corner = [&](int i) { return static_cast<int32_t>(quad[i]); };
    mesh.triangles.push_back({corner(0), corner(2), corner(1)});
    mesh.triangles.push_back({corner(0), corner(3), corner(2)});
  }
  mesh.normal = vertex_normals(mesh);
  if (!impl_->near.has_velocities()) return mesh;
  mesh.velocity.resize(points.size());
  parallel_for_cpu(static_cast<int64_t>(points.size()),
                   [&](int64_t i) { mesh.velocity[i] = impl_->near.velocity(mesh.position[i]); });
  return mesh;
}

void ParticleSurface::write_vdb(const std::string& path, double time) const {
  openvdb::GridPtrVec grids = {impl_->level_set};
  tbb::task_arena arena(num_threads());
  if (impl_->near.has_velocities())
    grids.push_back(arena.execute([&] { return velocity_grid(*impl_->level_set, impl_->near); }));
  for (const openvdb::GridBase::Ptr& grid : grids) grid->insertMeta("time", openvdb::DoubleMetadata(time));
  write_archive<openvdb::io::Archive>(path, openvdb::GridCPtrVec(grids.begin(), grids.end()));
}

}  // namespace graupel::io
