// What is refused of obstacles: meshes that bound no volume, files and grids that are too large.
#include "sparsegrid/obstacle_checks.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "sparsegrid/mesh/mesh_topology.h"
#include "sparsegrid/obstacle_set.h"
#include "sparsegrid/vdb/vdb_grids.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

void expect_mesh_error(const TriangleMesh& mesh, const std::string& part) {
  Scene scene = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5})});
  scene.obstacles[0].file = "bucket.obj";
  scene.obstacles[0].mesh = std::make_shared<TriangleMesh>(mesh);
  try {
    const ObstacleSet set(scene);
    ADD_FAILURE() << "the mesh was taken, which should not: " << part;
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("bucket.obj"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
}

TEST(ObstacleChecks, MeshesThatDoNotBoundAVolumeOnceAreRefused) {
  TriangleMesh flipped = cube_mesh(0.3);
  std::swap(flipped.triangles[3][0], flipped.triangles[3][1]);
  EXPECT_EQ(faults_of(flipped).open_edges, 0);
  EXPECT_EQ(faults_of(flipped).misdirected_edges, 3);
  expect_mesh_error(flipped, "face inwards beside others that face outwards (3 edges between them, the first near (");

  TriangleMesh doubled = cube_mesh(0.3);
  for (const auto& t : cube_mesh(0.3).triangles) doubled.triangles.push_back({t[1], t[2], t[0]});
  EXPECT_EQ(faults_of(doubled).misdirected_edges, 0);
  EXPECT_EQ(faults_of(doubled).doubled_triangles, 12);
  expect_mesh_error(doubled, "doubled faces (12 triangles");

  TriangleMesh inside_out = cube_mesh(0.3);  // has an inside as well
  for (auto& t : inside_out.triangles) std::swap(t[0], t[1]);
  const MeshFaults none = faults_of(inside_out);
  EXPECT_EQ(none.open_edges + none.misdirected_edges + none.doubled_triangles, 0);

  TriangleMesh huge = cube_mesh(0.3);
  huge.vertices[2] = {1e308, 0, 0};
  Scene scene = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5})});
  scene.obstacles[0].mesh = std::make_shared<TriangleMesh>(huge);
  EXPECT_THROW(ObstacleSet{scene}, ConfigError);
}

TEST(ObstacleChecks, BodiesFarSmallerThanAVoxelAreRefused) {
  Scene ball = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  ball.obstacles[0].radius = 1e-7;
  Scene mesh = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5})});  // mm read as m, say
  mesh.obstacles[0].mesh = std::make_shared<TriangleMesh>(cube_mesh(0.3e-3));
  for (const Scene& scene : {ball, mesh}) {
    try {
      const ObstacleSet set(scene);
      ADD_FAILURE() << "it was taken";
    } catch (const ConfigError& e) {
      EXPECT_NE(std::string(e.what()).find("obstacle_0_"), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find("on its grid (voxel 0.007812 m"), std::string::npos) << e.what();
    }
  }
}

TEST(ObstacleChecks, FoilsAndNeedlesAreRefused) {
  Scene needle = scene_with({make_obstacle(Shape::cone, {0.5, 0.5, 0.5})});
  needle.obstacles[0].radius = 1e-7;
  needle.obstacles[0].height = 0.3;
  Scene foil = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  foil.obstacles[0].size = {0.3, 1e-7, 0.3};
  for (const Scene& scene : {needle, foil}) {
    try {
      const ObstacleSet set(scene);
      ADD_FAILURE() << "it was taken";
    } catch (const ConfigError& e) {
      EXPECT_NE(std::string(e.what()).find("is thinner than a tenth of a voxel on its grid"), std::string::npos)
          << e.what();
    }
  }
  foil.obstacles[0].size[1] = 0.3 * foil.voxel();  // a plate
  EXPECT_NO_THROW(ObstacleSet{foil});
}

TEST(ObstacleChecks, TheEstimateOfGridsIsThatOfWhatIsBuilt) {
  Scene scene = scene_with({});
  for (int i = 0; i < 12; ++i) {
    Obstacle body = make_obstacle(solid_shapes[i % 7], {0.5, 0.5, 0.5});
    body.radius = 0.02 + 0.02 * i, body.height = 0.1 + 0.03 * i, body.size = Vec3d::filled(0.05 + 0.04 * i);
    scene.obstacles.push_back(body);
  }
  scene.obstacle_band = 0.04;
  const ObstacleSet set(scene);
  double bytes = 0;
  for (int i = 0; i < set.count(); ++i) bytes += static_cast<double>(set.facts(i).bytes);
  EXPECT_LT(grid_bytes(scene), 2.5 * bytes);
  EXPECT_GT(grid_bytes(scene), bytes / 1.5);
  EXPECT_NO_THROW(check_grids_fit(scene, grid_bytes(scene)));
  Scene twice = scene;
  for (Obstacle body : scene.obstacles) {
    body.position = {0.3, 0.3, 0.3};
    twice.obstacles.push_back(body);
  }
  EXPECT_EQ(grid_bytes(twice), grid_bytes(scene)) << "equal bodies share a grid";
  try {
    check_grids_fit(scene, 1e6);
    ADD_FAILURE() << "12 grids fit into 1 MB";
  } catch (const ConfigError& e) {
    for (const char* part : {"12 obstacles", "GB needed, 0.001 GB available", "obstacle_voxel", "obstacle_band"})
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
}

std::string file_in_temp(const std::string& name) {
  return testing::TempDir() + "graupel_checks_" + std::to_string(::getpid()) + "_" + name;
}

Scene with_file(const std::string& file, double voxel) {
  Scene scene = scene_with({make_obstacle(Shape::vdb, {0.5, 0.5, 0.5})});
  scene.obstacles[0].file = file;
  scene.obstacle_voxel = voxel;
  return scene;
}

template <typename ErrorType>
void expect_refusal(const Scene& scene, const std::string& part) {
  const Stopwatch watch;
  try {
    const ObstacleSet set(scene);
    ADD_FAILURE() << "it was taken";
  } catch (const ErrorType& e) {
    EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
  EXPECT_LT(watch.seconds(), 20);
}

TEST(ObstacleChecks, AVdbFileOnAVeryFineGridIsRefusedAtOnce) {
  const std::string file = file_in_temp("fine.vdb");
  ObstacleSet(scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.03)).write_vdb(file);
  expect_refusal<ConfigError>(with_file(file, 1e-4), "is too large for its grid");
  Scene wide = with_file(file, 0.004);
  wide.obstacle_band = 1e9;
  expect_refusal<ConfigError>(wide, "is too large for its grid");
  std::filesystem::remove(file);
}

/// They took gigabytes: the library goes on with whatever numbers it has.
TEST(ObstacleChecks, TruncatedVdbFilesAreInputErrorsInLittleTime) {
  const std::string whole = file_in_temp("whole.vdb"), cut = file_in_temp("cut.vdb");
  ObstacleSet(scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.05)).write_vdb(whole);
  const std::string bytes = read_file(whole);
  for (std::size_t size = 100; size + 1 < bytes.size(); size += size < 3000 ? 150 : bytes.size() / 7) {
    std::filesystem::remove(cut);
    std::ofstream(cut, std::ios::binary) << bytes.substr(0, size);
    expect_refusal<InputError>(with_file(cut, 0.025), "finds its end in the middle of a grid");
    EXPECT_THROW(inspect_vdb(cut), InputError) << size;
  }
  std::filesystem::remove(whole);
  std::filesystem::remove(cut);
}

TEST(ObstacleChecks, AFilledVdbFileIsRefused) {
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create(1.0f);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(0.01));
  grid->fill(openvdb::CoordBBox(0, 0, 0, 511, 511, 511), -1.0f, /*active=*/true);  // 64 tiles, 134 million voxels
  const std::string file = file_in_temp("filled.vdb");
  openvdb::io::File(file).write({grid});
  EXPECT_LT(std::filesystem::file_size(file), 1000000u);
  expect_refusal<InputError>(with_file(file, 0.01), "134217728 active voxels");
  std::filesystem::remove(file);
}

TEST(VdbFacts, AnEmptyGridHasNoBoxAndVectorsNoNumbers) {
  initialize_openvdb();
  const std::string path = file_in_temp("empty.vdb");
  openvdb::io::File(path).write({openvdb::FloatGrid::create(0.5f), openvdb::Vec3SGrid::create()});
  const std::vector<GridFacts> facts = inspect_vdb(path);
  ASSERT_EQ(facts.size(), 2u);
  for (const GridFacts& grid : facts) {
    EXPECT_EQ(grid.active_voxels, 0);
    EXPECT_EQ(grid.index_low, (Vec3i{0, 0, 0}));
    EXPECT_EQ(grid.index_high, (Vec3i{0, 0, 0}));
    EXPECT_EQ(grid.world_low, (Vec3d{0, 0, 0}));
    EXPECT_EQ(grid.world_high, (Vec3d{0, 0, 0}));
  }
  EXPECT_EQ(facts[0].holds_numbers + facts[1].holds_numbers, 1);
}

}  // namespace
}  // namespace graupel::sparsegrid
