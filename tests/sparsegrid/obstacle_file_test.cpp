// Obstacles from meshes and .vdb files, and what is refused of them.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/mesh/mesh_topology.h"
#include "sparsegrid/obstacle_set.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

std::string file_in_temp(const std::string& name) {
  return testing::TempDir() + "graupel_" + std::to_string(::getpid()) + "_" + name;
}

Obstacle vdb_obstacle(const std::string& file, const Vec3d& position, double scale = 1) {
  Obstacle obstacle = make_obstacle(Shape::vdb, position);
  obstacle.file = file;
  obstacle.scale = scale;
  return obstacle;
}

double largest_difference(const ObstacleSet& a, const ObstacleSet& b) {
  const Random random(5, RandomPurpose::test);
  double worst = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = random_point(random, i, 0.1, 0.9);
    worst = std::max(worst, std::abs(a.sample(x).phi - b.sample(x).phi));
  }
  return worst;
}

TEST(ObstacleFile, VdbRoundTripKeepsEveryDistance) {
  for (const Shape shape : {Shape::box, Shape::cone}) {
    const std::string file = file_in_temp("round_trip.vdb");
    const Scene scene = scene_with({make_obstacle(shape, {0.5, 0.5, 0.5})});
    const ObstacleSet set(scene);
    set.write_vdb(file);
    const ObstacleSet back(scene_with({vdb_obstacle(file, {0.5, 0.5, 0.5})}));
    EXPECT_EQ(largest_difference(set, back), 0) << word_of(shape);
    EXPECT_EQ(set.facts(0).active_voxels, back.facts(0).active_voxels);
    std::filesystem::remove(file);
  }
}

TEST(ObstacleFile, VdbOfAnotherVoxelBandAndScaleIsRebuilt) {
  const std::string file = file_in_temp("rebuilt.vdb");
  Scene half = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  half.obstacles[0].size = half.obstacles[0].size * 0.5;
  half.obstacle_voxel = 0.003;
  half.obstacle_band = 0.012;
  ObstacleSet(half).write_vdb(file);
  const Scene full = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  const ObstacleSet back(scene_with({vdb_obstacle(file, {0.5, 0.5, 0.5}, 2)}));
  EXPECT_LT(largest_difference(ObstacleSet(full), back), full.voxel());
  EXPECT_NEAR(back.facts(0).background, full.band(), 1e-7);
  std::filesystem::remove(file);
}

TEST(ObstacleFile, WrittenUnionHoldsAllObstacles) {
  const std::string file = file_in_temp("union.vdb");
  const Scene scene = scene_with(
      {make_obstacle(Shape::sphere, {0.3, 0.5, 0.5}), make_obstacle(Shape::box, {0.65, 0.5, 0.5}, {1, 1, 1}, 20)},
      0.03);
  const ObstacleSet set(scene);
  set.write_vdb(file);
  const auto facts = inspect_vdb(file);
  ASSERT_EQ(facts.size(), 3u);
  std::vector<std::string> names;
  for (const auto& one : facts) names.push_back(one.name);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"obstacle_0_sphere", "obstacle_1_box", "obstacles"}));
  for (const auto& one : facts) {
    EXPECT_EQ(one.grid_class, "level set");
    EXPECT_NEAR(one.background, scene.band(), 1e-7);
    EXPECT_LT(one.min_value, -0.05);
    EXPECT_GT(one.active_voxels, 1000);
    if (one.name == "obstacles") {
      EXPECT_LT(one.world_low[0], 0.16 - 0.05);  // world frame: from the sphere's left side on
      EXPECT_GT(one.world_high[0], 0.8);
    }
  }
  std::filesystem::remove(file);
}

TEST(ObstacleFile, CellNormalsAreWritten) {
  const std::string file = file_in_temp("normals.vdb");
  const Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.03);
  const CellNormals normals(scene, ObstacleSet(scene));
  normals.write_vdb(file);
  const auto facts = inspect_vdb(file);
  ASSERT_EQ(facts.size(), 1u);
  EXPECT_EQ(facts[0].name, "cell_normals");
  EXPECT_EQ(facts[0].active_voxels, normals.active_cells());
  std::filesystem::remove(file);
}

TEST(ObstacleFile, MeshOfACubeEqualsTheBox) {
  Scene mesh_scene = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5}, {0, 1, 1}, 25)});
  mesh_scene.obstacles[0].mesh = std::make_shared<TriangleMesh>(cube_mesh(0.3));
  Scene box_scene = mesh_scene;
  box_scene.obstacles[0].shape = Shape::box;
  box_scene.obstacles[0].size = {0.3, 0.3, 0.3};
  const ObstacleSet from_mesh(mesh_scene), from_box(box_scene);
  // OpenVDB spreads the nearest triangle from voxel to voxel, which errs a little off the corners, outside.
  EXPECT_LT(largest_difference(from_mesh, from_box), 0.06 * box_scene.voxel());
  const Random random(6, RandomPurpose::test);
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = random_point(random, i, 0.3, 0.7);
    const double expected = from_box.sample(x).phi;
    if (expected < 0.5 * box_scene.voxel()) {
      ASSERT_NEAR(from_mesh.sample(x).phi, expected, 1e-3 * box_scene.voxel());
    }
  }
}

TEST(ObstacleFile, OpenMeshIsRefusedByName) {
  TriangleMesh mesh = cube_mesh(0.3);
  EXPECT_EQ(faults_of(mesh).open_edges, 0);
  TriangleMesh soup;  // every triangle with vertices of its own, as in STL
  for (const auto& t : mesh.triangles) {
    const auto n = static_cast<int32_t>(soup.vertices.size());
    for (const int32_t v : t) soup.vertices.push_back(mesh.vertices[v]);
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  EXPECT_EQ(faults_of(soup).open_edges, 0);
  mesh.triangles.pop_back();
  EXPECT_EQ(faults_of(mesh).open_edges, 3);
  Scene scene = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5})});
  scene.obstacles[0].file = "bucket.obj";
  scene.obstacles[0].mesh = std::make_shared<TriangleMesh>(mesh);
  try {
    const ObstacleSet set(scene);
    FAIL() << "an open mesh was taken";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("bucket.obj"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("not closed"), std::string::npos);
  }
  scene.obstacles[0].mesh = nullptr;
  EXPECT_THROW(ObstacleSet{scene}, InputError);
}

TEST(ObstacleFile, BadVdbFilesAreInputErrors) {
  EXPECT_THROW(ObstacleSet(scene_with({vdb_obstacle(file_in_temp("missing.vdb"), {0, 0, 0})})), InputError);
  EXPECT_THROW(inspect_vdb(file_in_temp("missing.vdb")), InputError);

  const std::string junk = file_in_temp("junk.vdb");
  std::ofstream(junk) << "this is not a grid";
  EXPECT_THROW(ObstacleSet(scene_with({vdb_obstacle(junk, {0, 0, 0})})), InputError);
  EXPECT_THROW(inspect_vdb(junk), InputError);
  std::filesystem::remove(junk);

  const Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.03);
  const std::string cut = file_in_temp("cut.vdb");
  ObstacleSet(scene).write_vdb(cut);
  std::filesystem::resize_file(cut, std::filesystem::file_size(cut) / 2);
  EXPECT_THROW(ObstacleSet(scene_with({vdb_obstacle(cut, {0, 0, 0})})), InputError);
  std::filesystem::remove(cut);

  const std::string vectors = file_in_temp("vectors.vdb");  // a good file without a level set
  CellNormals(scene, ObstacleSet(scene)).write_vdb(vectors);
  EXPECT_THROW(ObstacleSet(scene_with({vdb_obstacle(vectors, {0, 0, 0})})), InputError);
  std::filesystem::remove(vectors);
}

/// Replaces the first (or every) `from` in a file by `to` of the same length.
void patch_file(const std::string& path, const std::string& from, const std::string& to, bool all) {
  std::string bytes = read_file(path);
  std::size_t at = bytes.find(from), patched = 0;
  for (; at != std::string::npos; at = all ? bytes.find(from, at + 1) : std::string::npos, ++patched)
    bytes.replace(at, to.size(), to);
  ASSERT_GT(patched, 0u);
  std::ofstream(path, std::ios::binary) << bytes;
}

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

TEST(ObstacleFile, VdbThatSaysItIsHugeIsNotRead) {
  const std::string file = file_in_temp("huge.vdb");
  const Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.05);
  const ObstacleSet set(scene);
  set.write_vdb(file);
  const std::string key = "file_voxel_count" + bytes_of<int32_t>({5}) + "int64" + bytes_of<int32_t>({8});
  patch_file(file, key + bytes_of<int64_t>({set.facts(0).active_voxels}), key + bytes_of<int64_t>({int64_t(1) << 40}),
             false);
  for (const auto& read : {+[](const std::string& f) {
                             ObstacleSet(scene_with({vdb_obstacle(f, {0, 0, 0})}));
                           },
                           +[](const std::string& f) { inspect_vdb(f); }}) {
    try {
      read(file);
      FAIL() << "2^40 voxels were taken";
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("too large"), std::string::npos) << e.what();
    }
  }
  std::filesystem::remove(file);
}

/// What OpenVDB stores of a transform by one scale: scale, voxel, 1/scale, 1/scale^2, 1/(2 scale), three times each.
std::string scale_map_bytes(double scale) {
  std::vector<double> values;
  for (const double v : {scale, scale, 1 / scale, 1 / (scale * scale), 0.5 / scale}) values.insert(values.end(), 3, v);
  return bytes_of(values);
}

TEST(ObstacleFile, LevelSetThatIsNoDistanceIsRebuilt) {
  const std::string file = file_in_temp("steep.vdb");
  Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 1.0 / 32);
  ObstacleSet(scene).write_vdb(file);
  // Half the voxel with the same values: a sphere of half the radius whose values are twice the distance.
  patch_file(file, scale_map_bytes(scene.voxel()), scale_map_bytes(scene.voxel() / 2), true);
  Scene small = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 1.0 / 64);
  small.obstacles[0].radius /= 2;
  const ObstacleSet back(scene_with({vdb_obstacle(file, {0.5, 0.5, 0.5})}, 1.0 / 64));
  EXPECT_LT(largest_difference(ObstacleSet(small), back), 0.2 * small.voxel());
  std::filesystem::remove(file);
}

TEST(ObstacleFile, AScaleThatLeavesNoVoxelsIsNamed) {
  const std::string file = file_in_temp("metres.vdb");
  ObstacleSet(scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})})).write_vdb(file);
  try {
    const ObstacleSet set(scene_with({vdb_obstacle(file, {0.5, 0.5, 0.5}, 1e-3)}));
    ADD_FAILURE() << "it was taken";
  } catch (const ConfigError& e) {
    for (const char* part : {"obstacle_0_vdb", "metres.vdb", "too small at this scale (7.8125", "larger scale"})
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
  std::filesystem::remove(file);
}

TEST(ObstacleFile, WritingSaysWhatFailed) {
  const ObstacleSet set(scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})}, 0.05));
  EXPECT_THROW(set.write_vdb(file_in_temp("no/such/folder/out.vdb")), IoError);
  EXPECT_THROW(ObstacleSet().write_vdb(file_in_temp("none.vdb")), ConfigError);
}

}  // namespace
}  // namespace graupel::sparsegrid
