// The look-up and push_out inside kernels: the GPU gives what the CPU gives.
#include <gtest/gtest.h>

#include <cstring>

#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/push_out.h"
#include "tests/gpu_only.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

struct Row {
  SignedDistance<float> distance;
  int nearest;
  Vec3f pushed, cell_normal;
};

struct LookUp {
  ObstacleSetView set;
  CellNormalsView normals;
  const Vec3f* before;
  const Vec3f* after;
  Row* out;
  GRAUPEL_HD void operator()(int64_t i) const {
    Row& row = out[i];
    row.distance = signed_distance(set, after[i], row.nearest);
    row.pushed = after[i];
    push_out(set, Vec3f::filled(0.05f), Vec3f::filled(0.95f), before[i], row.pushed);
    row.cell_normal = normals.at(after[i].cast<double>());
  }
};

std::vector<Row> rows_of(Device device, const ObstacleSetView& set, const CellNormalsView& normals,
                         const std::vector<Vec3f>& before, const std::vector<Vec3f>& after) {
  Buffer<Vec3f> a(device, 0), b(device, 0);
  a.upload(before);
  b.upload(after);
  Buffer<Row> out(device, before.size());
  parallel_for(device, static_cast<int64_t>(before.size()), LookUp{set, normals, a.data(), b.data(), out.data()});
  return out.download();
}

std::vector<Row> rows_on(Device device, const ObstacleSet& set, const CellNormals& normals,
                         const std::vector<Vec3f>& before, const std::vector<Vec3f>& after) {
  return rows_of(device, set.view(device), normals.view(device), before, after);
}

struct KernelScene {
  Scene scene = scene_with({make_obstacle(Shape::cone, {0.3, 0.3, 0.3}, {1, 0, 1}, 50),
                            make_obstacle(Shape::box, {0.6, 0.35, 0.4}, {0, 1, 1}, 70),
                            make_obstacle(Shape::plane, {0, 0.15, 0}, {1, 0, 0}, 3)});
  ObstacleSet set{scene};
  CellNormals normals{scene, set};
  std::vector<Vec3f> before, after;
  KernelScene() {
    const Random random(9, RandomPurpose::test);
    for (uint64_t i = 0; i < 20000; ++i) {
      before.push_back(random_point(random, 2 * i, 0.06, 0.94).cast<float>());
      after.push_back(before.back() + random_point(random, 2 * i + 1, -0.03, 0.03).cast<float>());
    }
  }
};

TEST(ObstacleKernel, CpuKernelEqualsTheHostLookUp) {
  const KernelScene s;
  const auto rows = rows_on(Device::cpu, s.set, s.normals, s.before, s.after);
  int inside = 0, cells = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    int nearest = -2;
    const auto expected = s.set.sample(s.after[i].cast<double>(), &nearest);
    ASSERT_NEAR(rows[i].distance.phi, expected.phi, 1e-6);
    ASSERT_EQ(rows[i].cell_normal, s.normals.at(s.after[i].cast<double>()));
    inside += expected.phi < 0;
    cells += norm(rows[i].cell_normal) > 0;
  }
  EXPECT_GT(inside, 500);
  EXPECT_GT(cells, 200);
}

TEST(ObstacleKernel, GpuEqualsTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const KernelScene s;
  const auto cpu = rows_on(Device::cpu, s.set, s.normals, s.before, s.after);
  const auto gpu = rows_on(Device::cuda, s.set, s.normals, s.before, s.after);
  int index_differs = 0, far = 0;
  for (std::size_t i = 0; i < cpu.size(); ++i) {
    ASSERT_NEAR(cpu[i].distance.phi, gpu[i].distance.phi, 1e-6);
    ASSERT_EQ(cpu[i].cell_normal, gpu[i].cell_normal);
    index_differs += cpu[i].nearest != gpu[i].nearest;
    // A decision that falls the other way by rounding leads to another place, which is as free.
    far += norm(cpu[i].pushed - gpu[i].pushed) > 1e-4f;
    if (s.set.sample(s.before[i].cast<double>()).phi < 0) continue;
    ASSERT_GE(s.set.sample(gpu[i].pushed.cast<double>()).phi, -1e-6 / 64);
  }
  EXPECT_LE(index_differs, 5);
  EXPECT_LE(far, 20);
}

/// Every bit of a row.
bool same(const Row& a, const Row& b) { return std::memcmp(&a, &b, sizeof(Row)) == 0; }

TEST(ObstacleKernel, ListsChangeNothingOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  std::vector<Obstacle> obstacles;
  const Random random(10, RandomPurpose::test);
  for (uint64_t i = 0; i < 90; ++i) {
    obstacles.push_back(make_obstacle(i == 50 ? Shape::plane : solid_shapes[i % 7], random_point(random, 2 * i, 0, 1),
                                      random_point(random, 2 * i + 1, -1, 1), 5));
    obstacles.back().radius = obstacles.back().height = 0.06;
    obstacles.back().size = Vec3d::filled(0.08);
  }
  const ObstacleSet set(scene_with(obstacles));
  std::vector<Vec3f> before, after;
  for (uint64_t i = 0; i < 50000; ++i) {
    before.push_back(random_point(random, 2 * i, -0.2, 1.2).cast<float>());
    after.push_back(before.back() + random_point(random, 2 * i + 1, -0.03, 0.03).cast<float>());
  }
  ObstacleSetView all = set.view(Device::cuda);
  ASSERT_NE(all.cells.begin, nullptr);
  const auto listed = rows_of(Device::cuda, all, {}, before, after);
  all.cells = {};
  const auto asked = rows_of(Device::cuda, all, {}, before, after);
  int near = 0;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    ASSERT_TRUE(same(listed[i], asked[i])) << i;
    near += listed[i].nearest >= 0;
  }
  EXPECT_GT(near, 5000);
}

}  // namespace
}  // namespace graupel::sparsegrid
