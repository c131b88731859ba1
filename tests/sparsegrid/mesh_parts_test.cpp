// Meshes of several parts: the region that they bound, in volumes and level sets.
#include "sparsegrid/mesh/mesh_parts.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <unistd.h>

#include <filesystem>

#include "core/system/stopwatch.h"
#include "sparsegrid/mesh/mesh_volume.h"
#include "sparsegrid/obstacle_set.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

/// A cube of edge `size` about `center`, turned inside out where asked.
void add_cube(TriangleMesh& mesh, double size, const Vec3d& center, bool inwards = false) {
  const auto first = static_cast<int32_t>(mesh.vertices.size());
  const TriangleMesh cube = cube_mesh(size);
  for (const Vec3d& v : cube.vertices) mesh.vertices.push_back(v + center);
  for (const auto& t : cube.triangles) {
    mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    if (inwards) std::swap(mesh.triangles.back()[1], mesh.triangles.back()[2]);
  }
}

Scene scene_of(const TriangleMesh& mesh, double dx = 1.0 / 64) {
  Scene scene = scene_with({make_obstacle(Shape::mesh, {0.5, 0.5, 0.5})}, dx);
  scene.obstacles[0].mesh = std::make_shared<TriangleMesh>(mesh);
  return scene;
}

TEST(MeshParts, DisjointPartsAddUpWhereverTheyFace) {
  for (const bool inwards : {false, true}) {
    TriangleMesh mesh;
    add_cube(mesh, 0.2, {-0.2, 0, 0});
    add_cube(mesh, 0.1, {0.2, 0, 0}, inwards);
    EXPECT_NEAR(mesh_volume(mesh), 0.009, 1e-15);
    const ObstacleSet set(scene_of(mesh));
    EXPECT_LT(set.sample({0.3, 0.5, 0.5}).phi, -0.05);
    EXPECT_LT(set.sample({0.7, 0.5, 0.5}).phi, -0.04);
  }
}

TEST(MeshParts, WhatPartsShareCountsOnce) {
  for (const bool inwards : {false, true}) {
    TriangleMesh overlap, nested, apart;
    add_cube(overlap, 0.2, {0, 0, 0});
    add_cube(overlap, 0.2, {0.1, 0.05, -0.02}, inwards);
    EXPECT_NEAR(mesh_volume(overlap), 0.016 - 0.1 * 0.15 * 0.18, 1e-12);
    if (inwards) continue;
    add_cube(nested, 0.3, {0, 0, 0});
    add_cube(nested, 0.2, {0.01, 0.02, 0}, inwards);
    EXPECT_NEAR(mesh_volume(nested), 0.027, 1e-12);
  }
}

TEST(MeshParts, WallsThatFaceTheOtherWayBoundACavity) {
  for (const bool inside_out : {false, true}) {
    TriangleMesh mesh;
    add_cube(mesh, 0.4, {0, 0, 0}, inside_out);
    add_cube(mesh, 0.3, {0, 0, 0}, !inside_out);
    EXPECT_NEAR(mesh_volume(mesh), 0.064 - 0.027, 1e-12);
    add_cube(mesh, 0.1, {0, 0, 0}, inside_out);  // a body within
    EXPECT_NEAR(mesh_volume(mesh), 0.064 - 0.027 + 0.001, 1e-12);
    const auto parts = parts_of(mesh);
    ASSERT_EQ(parts.size(), 3u);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(parts[static_cast<std::size_t>(i)].level, i);

    const ObstacleSet set(scene_of(mesh));
    const double h = 1.0 / 128;  // voxel
    for (const auto& [y, phi] : {std::pair(0.5, -0.05), {0.58, 0.03}, {0.63, 0.02}, {0.66, -0.01}, {0.72, 0.02}})
      EXPECT_NEAR(set.sample({0.5, y, 0.5}).phi, phi, 0.1 * h) << y;
  }
}

TEST(MeshParts, ManyCavitiesTakeTheTimeOfTheirTriangles) {
  TriangleMesh mesh;
  add_cube(mesh, 1, {0, 0, 0});
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      for (int k = 0; k < 20; ++k) add_cube(mesh, 0.02, {0.04 * i - 0.38, 0.04 * j - 0.38, 0.04 * k - 0.38}, true);
  const Stopwatch watch;
  const auto parts = parts_of(mesh);
  EXPECT_LT(watch.seconds(), 5);  // 0.2 s on an idle core
  ASSERT_EQ(parts.size(), 8001u);
  for (std::size_t p = 1; p < parts.size(); ++p) ASSERT_EQ(parts[p].level, 1) << p;
  EXPECT_NEAR(mesh_volume(mesh), 1 - 8000 * 8e-6, 1e-9);
}

TEST(MeshParts, ALevelSetThatIsRebuiltKeepsItsCavities) {
  const std::string file = testing::TempDir() + "graupel_" + std::to_string(::getpid()) + "_hollow.vdb";
  TriangleMesh mesh;
  add_cube(mesh, 0.4, {0, 0, 0});
  add_cube(mesh, 0.2, {0, 0, 0}, true);
  ObstacleSet(scene_of(mesh)).write_vdb(file);
  Scene scene = scene_with({make_obstacle(Shape::vdb, {0.5, 0.5, 0.5})}, 1.0 / 40);
  scene.obstacles[0].file = file;
  const ObstacleSet set(scene);
  EXPECT_GT(set.sample({0.5, 0.5, 0.5}).phi, 0.05);
  EXPECT_NEAR(set.sample({0.5, 0.65, 0.5}).phi, -0.05, 0.005);
  EXPECT_NEAR(set.sample({0.5, 0.73, 0.5}).phi, 0.03, 0.005);
  std::filesystem::remove(file);
}

TEST(MeshParts, AWrittenPlaneIsABodyThatOtherScenesTake) {
  const std::string file = testing::TempDir() + "graupel_" + std::to_string(::getpid()) + "_plane.vdb";
  for (const double degrees : {0.0, 15.0}) {
    const Scene scene = scene_with({make_obstacle(Shape::plane, {0.5, 0.5, 0.5}, {0, 0, 1}, degrees)});
    const ObstacleSet planes(scene);
    planes.write_vdb(file);
    openvdb::io::File written(file);
    written.open();
    const auto all = openvdb::gridPtrCast<openvdb::FloatGrid>(written.readGrid("obstacles"));
    for (int y = 0; y <= 128; ++y) {
      const Vec3d x = {0.5, y / 128.0, 0.25};
      EXPECT_NEAR(all->tree().getValue({64, y, 32}), planes.sample(x).phi, 1e-6) << x[1];
    }
    for (const double dx : {1.0 / 64, 1.0 / 40}) {
      Scene read = scene_with({make_obstacle(Shape::vdb, {0.5, 0.5, 0.5}, {0, 0, 1}, degrees)}, dx);
      read.obstacles[0].file = file;
      const ObstacleSet set(read);
      const Random random(3, RandomPurpose::test);
      for (uint64_t i = 0; i < 400; ++i) {
        const Vec3d x = random_point(random, i, 0, 1);
        const double limit = std::min(scene.band(), read.band());
        const double phi = std::clamp(planes.sample(x).phi, -limit, limit);
        ASSERT_NEAR(std::clamp(set.sample(x).phi, -limit, limit), phi, 1e-3) << x[1] << " at " << dx;
      }
    }
  }
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace graupel::sparsegrid
