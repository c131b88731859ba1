// Surfaces of particles: volume, closedness, normals, velocities, bounds; and the files that hold them.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetMeasure.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "expect_error.h"
#include "io/export/export.h"
#include "io/mesh/mesh_file.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr double spacing = 0.02;

/// Places of a lattice in the cube of edge `edge` about the origin where `inside` holds.
template <typename Inside>
std::vector<Vec3f> lattice(double edge, const Inside& inside) {
  std::vector<Vec3f> position;
  const int n = static_cast<int>(std::lround(edge / spacing));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) {
        const Vec3d x = Vec3d{i + 0.5, j + 0.5, k + 0.5} * spacing - Vec3d::filled(0.5 * edge);
        if (inside(x)) position.push_back(x.cast<float>());
      }
  return position;
}
std::vector<Vec3f> block(double edge) {
  return lattice(edge, [](const Vec3d&) { return true; });
}
std::vector<Vec3f> ball(double radius) {
  return lattice(2 * radius, [&](const Vec3d& x) { return norm(x) < radius; });
}
/// A block of places drawn at random, as sources have them.
std::vector<Vec3f> random_block(double edge) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> along(static_cast<float>(-0.5 * edge), static_cast<float>(0.5 * edge));
  std::vector<Vec3f> position(static_cast<std::size_t>(std::pow(edge / spacing, 3)));
  for (Vec3f& x : position)
    for (int axis = 0; axis < 3; ++axis) x[axis] = along(random);
  return position;
}

ParticleSurface surface_of(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity = {}) {
  return {position, velocity, default_surface_settings(spacing), "frame 0"};
}

double volume_of(const SurfaceMesh& mesh) {
  double six_times = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    six_times +=
        dot(mesh.position[a].cast<double>(), cross(mesh.position[b].cast<double>(), mesh.position[c].cast<double>()));
  return six_times / 6;
}

/// Directed edges that are not met by one of the other direction, counted with their number.
int unmatched_edges(const SurfaceMesh& mesh) {
  std::map<std::pair<int32_t, int32_t>, int> surplus;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const int32_t from = triangle[i], to = triangle[(i + 1) % 3];
      surplus[std::minmax(from, to)] += from < to ? 1 : -1;
    }
  int unmatched = 0;
  for (const auto& [edge, count] : surplus) unmatched += std::abs(count);
  return unmatched;
}

/// Edges that are not shared by exactly two triangles.
int edges_not_of_two(const SurfaceMesh& mesh) {
  std::map<std::pair<int32_t, int32_t>, int> uses;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++uses[std::minmax(triangle[i], triangle[(i + 1) % 3])];
  int wrong = 0;
  for (const auto& [edge, count] : uses) wrong += count != 2;
  return wrong;
}

TEST(Surface, BlockAndBallHaveTheirVolume) {
  EXPECT_NEAR(volume_of(surface_of(block(0.3)).mesh()) / std::pow(0.3, 3), 1, 0.05);
  EXPECT_NEAR(volume_of(surface_of(random_block(0.3)).mesh()) / std::pow(0.3, 3), 1, 0.05);
  EXPECT_NEAR(volume_of(surface_of(ball(0.16)).mesh()) / (4.0 / 3 * std::numbers::pi * std::pow(0.16, 3)), 1, 0.05);
}

TEST(Surface, FacesOfABlockAreFlatAndInPlace) {
  const SurfaceMesh mesh = surface_of(block(0.3)).mesh();
  double sum = 0, squares = 0;
  int count = 0;
  for (const Vec3f& x : mesh.position) {
    if (x[1] < 0.1f || std::abs(x[0]) > 0.1f || std::abs(x[2]) > 0.1f) continue;
    sum += x[1] - 0.15;
    squares += (x[1] - 0.15) * (x[1] - 0.15);
    ++count;
  }
  ASSERT_GT(count, 100);
  EXPECT_LT(std::abs(sum / count), 0.05 * spacing);
  EXPECT_LT(std::sqrt(squares / count), 0.1 * spacing);
}

TEST(Surface, IsClosedWithNormalsOutwards) {
  const SurfaceMesh mesh = surface_of(ball(0.12)).mesh();
  EXPECT_EQ(edges_not_of_two(mesh), 0);
  EXPECT_EQ(unmatched_edges(mesh), 0);
  double least = 1;
  for (std::size_t i = 0; i < mesh.position.size(); ++i)
    least = std::min(least, static_cast<double>(dot(mesh.normal[i], normalized(mesh.position[i]))));
  EXPECT_GT(least, 0.9);
  EXPECT_EQ(edges_not_of_two(surface_of(block(0.2)).mesh()), 0);
}

TEST(Surface, SprayIsKeptAsDropsOfItsVolume) {
  std::vector<Vec3f> position;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 5; ++j) position.push_back(Vec3f{0.2f * i + 0.003f * j, 0.2f * j, 0.001f * i});
  const SurfaceMesh mesh = surface_of(position).mesh();
  EXPECT_EQ(unmatched_edges(mesh), 0);
  EXPECT_NEAR(volume_of(mesh) / (25 * std::pow(spacing, 3)), 1, 0.15);
  SurfaceSettings fine = default_surface_settings(spacing);
  fine.voxel *= 0.5;
  EXPECT_NEAR(volume_of(ParticleSurface(position, {}, fine, "").mesh()) / (25 * std::pow(spacing, 3)), 1, 0.1);
}

TEST(Surface, VelocitiesAreThoseOfTheParticlesNear) {
  const std::vector<Vec3f> position = block(0.2);
  const Vec3f constant{1, -2, 3};
  const SurfaceMesh moved = surface_of(position, std::vector<Vec3f>(position.size(), constant)).mesh();
  ASSERT_EQ(moved.velocity.size(), moved.position.size());
  for (const Vec3f& v : moved.velocity) EXPECT_LT(norm(v - constant), 1e-5f);
  // A rotation about y: the average lags behind the surface by less than the kernel's radius.
  std::vector<Vec3f> velocity;
  for (const Vec3f& x : position) velocity.push_back({x[2], 0, -x[0]});
  const SurfaceMesh turned = surface_of(position, velocity).mesh();
  for (std::size_t i = 0; i < turned.position.size(); ++i) {
    const Vec3f& x = turned.position[i];
    EXPECT_LT(norm(turned.velocity[i] - Vec3f{x[2], 0, -x[0]}), 1.5 * spacing) << i;
  }
  EXPECT_TRUE(surface_of(position).mesh().velocity.empty());
}

TEST(Surface, DoesNotDependOnTheNumberOfThreads) {
  const std::vector<Vec3f> position = random_block(0.2);
  std::vector<Vec3f> velocity;
  for (const Vec3f& x : position) velocity.push_back(x);
  const int before = num_threads();
  set_num_threads(1);
  const SurfaceMesh one = surface_of(position, velocity).mesh();
  set_num_threads(4);
  const SurfaceMesh four = surface_of(position, velocity).mesh();
  set_num_threads(before);
  EXPECT_TRUE(one.position == four.position);
  EXPECT_TRUE(one.velocity == four.velocity);
  EXPECT_TRUE(one.triangles == four.triangles);
}

TEST(Surface, RefusesSizesOutOfRangeAndWhatDoesNotFit) {
  const auto with = [](auto change) {
    SurfaceSettings settings = default_surface_settings(spacing);
    change(settings);
    check_surface_settings(settings);
  };
  expect_error<ConfigError>([&] { with([](SurfaceSettings& s) { s.radius = 1; }); },
                            {"--radius 1 ", "allowed: 0.01 to 0.16"});
  expect_error<ConfigError>([&] { with([](SurfaceSettings& s) { s.voxel = 1e-9; }); },
                            {"--voxel 1e-09", "allowed: 0.001875 to 0.02"});
  expect_error<ConfigError>([&] { with([](SurfaceSettings& s) { s.smoothing = 101; }); },
                            {"--smoothing 101", "allowed: 0 to 100"});
  // Particles that are far apart share no blocks: 6 MB each with the finest voxels.
  std::vector<Vec3f> sparse;
  for (int i = 0; i < 200'000; ++i) sparse.push_back(Vec3f{float(i % 50), float(i / 50 % 50), float(i / 2500)});
  SurfaceSettings fine = default_surface_settings(spacing);
  fine.voxel = fine.radius / 16;
  expect_error<ConfigError>([&] { ParticleSurface(sparse, {}, fine, "frame 3, water"); },
                            {"frame 3, water", "GB", "available", "larger --voxel"});
}

TEST(Surface, RefusesPositionsThatAreNotFiniteOrFarAway) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e30f}) {
    std::vector<Vec3f> position = block(0.1);
    position[3][1] = bad;
    expect_error<DivergedError>([&] { surface_of(position); }, {"frame 0", "particle 3", "allowed with this voxel"});
  }
}

/// Two materials: a block of water (5) and one of sand (6) that move differently.
PointFrame two_blocks() {
  PointFrame points;
  points.time = 0.5;
  for (const int32_t type : {6, 5})
    for (const Vec3f& x : block(0.2)) {
      points.position.push_back(x + Vec3f{type == 5 ? 0.0f : 0.5f, 0, 0});
      points.velocity.push_back(type == 5 ? Vec3f{1, 0, 0} : Vec3f{0, 2, 0});
      points.particle_type.push_back(type);
      points.id.push_back(static_cast<int32_t>(points.id.size()));
    }
  return points;
}

class SurfaceFiles : public testing::Test {
 protected:
  void write(const std::string& format) {
    const auto writer = make_surface_writer(format, {.folder = folder_.path(), .name = "run", .frame_time = 0.1});
    for (const int64_t frame : {0, 5}) writer->write(frame, points_.time, surfaces_of(points_, bodies(), "frame 5"));
    writer->finish();
  }
  std::vector<SurfaceBody> bodies() const {
    return surface_bodies(points_.particle_type, points_.materials, default_surface_settings(spacing));
  }
  TemporaryFolder folder_;
  PointFrame points_ = two_blocks();
};

TEST_F(SurfaceFiles, AreOneAMaterialWithItsParticlesAlone) {
  const auto surfaces = surfaces_of(points_, bodies(), "frame 0");
  ASSERT_EQ(surfaces.size(), 2u);
  EXPECT_EQ(surfaces[0].material, "water");
  EXPECT_EQ(surfaces[1].material, "sand");
  const SurfaceMesh sand = surfaces[1].surface.mesh();
  for (std::size_t i = 0; i < sand.position.size(); ++i) {
    EXPECT_GT(sand.position[i][0], 0.35f);
    EXPECT_LT(norm(sand.velocity[i] - Vec3f{0, 2, 0}), 1e-5f);
  }
}

/// Sequences have a file of every material in all frames.
TEST_F(SurfaceFiles, ABodyWithoutParticlesHasASurfaceWithoutTriangles) {
  std::vector<SurfaceBody> all = bodies();
  all.push_back({8, std::nullopt, default_surface_settings(spacing)});
  for (const std::string& format : surface_formats()) {
    const auto writer = make_surface_writer(format, {.folder = folder_.path(), .name = "run"});
    const std::vector<MaterialSurface> surfaces = surfaces_of(points_, all, "frame 0");
    ASSERT_EQ(surfaces.size(), 3u);
    EXPECT_TRUE(surfaces[2].material == "snow" && surfaces[2].surface.mesh().triangles.empty());
    writer->write(0, points_.time, surfaces);
    writer->finish();
    if (format != "usda") {
      EXPECT_TRUE(std::filesystem::exists(folder_.file("run_snow_0000." + format))) << format;
    }
  }
}

TEST_F(SurfaceFiles, MeshesReadBack) {
  const SurfaceMesh water = surfaces_of(points_, bodies(), "")[0].surface.mesh();
  for (const std::string ending : {"obj", "ply"}) {
    write(ending);
    const TriangleMesh mesh = read_mesh(folder_.file("run_water_0005." + ending));
    ASSERT_EQ(mesh.vertices.size(), water.position.size()) << ending;
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
      ASSERT_TRUE(mesh.vertices[i].cast<float>() == water.position[i]) << ending << i;
    EXPECT_TRUE(mesh.triangles == water.triangles) << ending;
    EXPECT_EQ(read_mesh(folder_.file("run_sand_0000." + ending)).triangles.size(), water.triangles.size());
  }
}

TEST_F(SurfaceFiles, PvdNamesTheMaterials) {
  write("vtp");
  const std::string times = bytes_of(folder_.file("run.pvd"));
  EXPECT_NE(times.find("<DataSet timestep=\"0.5\" part=\"6\" name=\"sand\" file=\"run_sand_0005.vtp\"/>"),
            std::string::npos)
      << times;
  EXPECT_NE(bytes_of(folder_.file("run_sand_0005.vtp")).find("Name=\"velocity\""), std::string::npos);
}

TEST_F(SurfaceFiles, VdbHoldsLevelSetAndVelocities) {
  write("vdb");
  EXPECT_FALSE(std::filesystem::exists(folder_.file("run_water_0005.vdb.part")));
  openvdb::io::File file(folder_.file("run_water_0005.vdb"));
  file.open(false);
  const auto surface = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("surface"));
  const auto velocity = openvdb::gridPtrCast<openvdb::Vec3SGrid>(file.readGrid("v"));
  ASSERT_TRUE(surface && velocity);
  EXPECT_EQ(surface->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_NEAR(openvdb::tools::levelSetVolume(*surface) / std::pow(0.2, 3), 1, 0.06);
  EXPECT_EQ(velocity->activeVoxelCount(), surface->activeVoxelCount());
  EXPECT_NEAR(surface->voxelSize()[0], 0.5 * spacing, 1e-12);
  EXPECT_FLOAT_EQ(surface->background(), static_cast<float>(3 * surface->voxelSize()[0]));
  for (auto voxel = velocity->cbeginValueOn(); voxel; ++voxel)
    ASSERT_LT((*voxel - openvdb::Vec3s(1, 0, 0)).length(), 1e-5);
}

/// Two sands: the block of water is now another sand.
class SurfacesOfTwoSands : public SurfaceFiles {
 protected:
  void SetUp() override {
    points_.materials.names = {"dry", "wet/sand", "wet sand"};
    for (int32_t& type : points_.particle_type) {
      points_.materials.index.push_back(type == 6 ? 1 : 2);
      type = 6;
    }
  }
};

TEST_F(SurfacesOfTwoSands, AreTwoNamedByTheScene) {
  const auto surfaces = surfaces_of(points_, bodies(), "frame 0");
  ASSERT_EQ(surfaces.size(), 2u);
  EXPECT_EQ(surfaces[0].material, "wet_sand");
  EXPECT_EQ(surfaces[1].material, "wet_sand_2") << "names of files differ";
  EXPECT_EQ(surfaces[0].index, 1);
  for (const Vec3f& x : surfaces[0].surface.mesh().position) ASSERT_GT(x[0], 0.35f);
  for (const Vec3f& x : surfaces[1].surface.mesh().position) ASSERT_LT(x[0], 0.35f);
}

TEST_F(SurfacesOfTwoSands, HaveFilesOfTheirOwnInEveryFormat) {
  const std::size_t corners = surfaces_of(points_, bodies(), "")[0].surface.mesh().position.size();
  for (const std::string& format : surface_formats()) {
    write(format);
    if (format == "usda") continue;
    for (const std::string name : {"run_wet_sand_0005.", "run_wet_sand_2_0005."})
      EXPECT_TRUE(std::filesystem::exists(folder_.file(name + format))) << name << format;
  }
  EXPECT_EQ(read_mesh(folder_.file("run_wet_sand_0005.obj")).vertices.size(), corners);
  const std::string list = bytes_of(folder_.file("run.pvd"));
  EXPECT_NE(list.find("part=\"2\" name=\"wet_sand\" file=\"run_wet_sand_0005.vtp\""), std::string::npos) << list;
  EXPECT_NE(list.find("part=\"3\" name=\"wet_sand_2\""), std::string::npos) << list;
  EXPECT_NE(bytes_of(folder_.file("run_wet_sand_0005.vtp")).find("Name=\"material\""), std::string::npos);
  EXPECT_NE(bytes_of(folder_.file("run_wet_sand_0005.ply")).find("property int material\n"), std::string::npos);
  const std::string usda = bytes_of(folder_.file("run.usda"));
  EXPECT_NE(usda.find("def Mesh \"wet_sand\""), std::string::npos);
  EXPECT_NE(usda.find("def Mesh \"wet_sand_2\""), std::string::npos);
  EXPECT_NE(usda.find("int primvars:material = 2 ("), std::string::npos);
}

TEST_F(SurfacesOfTwoSands, NamesOfFilesDoNotLeaveTheFolder) {
  points_.materials.names = {"", "../../etc/passwd", std::string(500, '.') + "\n"};
  const auto surfaces = surfaces_of(points_, bodies(), "frame 0");
  EXPECT_EQ(surfaces[0].material, "______etc_passwd");
  EXPECT_EQ(surfaces[1].material, std::string(60, '_'));
}

TEST_F(SurfaceFiles, FolderThatCannotBeMadeIsAnError) {
  folder_.write("file", "x");
  expect_error<IoError>([&] { make_surface_writer("obj", {.folder = folder_.file("file/sub"), .name = "run"}); },
                        {"file/sub"});
}

}  // namespace
}  // namespace graupel::io
