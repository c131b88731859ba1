// Dense values of an obstacle's grid give the same look-ups as its tree, to the bit.
#include <gtest/gtest.h>

#include "sparsegrid/level_set_grid.h"
#include "sparsegrid/push_out.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

TEST(DenseValues, LookUpsAndPushesEqualThoseOfTheTree) {
  for (const Shape shape : solid_shapes) {
    const Scene scene = scene_with({make_obstacle(shape, {0.5, 0.4, 0.5}, {1, 2, 0.5}, 35)});
    const ObstacleSet set(scene);
    const ObstacleView tree = set.view().obstacles[0];
    ObstacleView dense = tree;
    const LevelSetGrid level_set = build_level_set(scene, scene.obstacles[0], "obstacle");
    const std::vector<float> values = dense_values(level_set, scene.voxel(), dense.dense);
    ASSERT_GT(values.size(), 1000u);
    dense.dense.values = values.data();
    const Random random(5, RandomPurpose::test);
    int pushed = 0;
    for (uint64_t i = 0; i < 5000; ++i) {
      const Vec3f before = random_point(random, 2 * i, 0.2, 0.8).cast<float>();
      const Vec3f wanted = before + random_point(random, 2 * i + 1, -0.01, 0.01).cast<float>();
      const auto a = signed_distance(tree, wanted), b = signed_distance(dense, wanted);
      ASSERT_EQ(a.phi, b.phi);
      ASSERT_TRUE(a.normal == b.normal);
      Vec3f x = wanted, y = wanted;
      const Vec3f low = {0, 0, 0}, high = {1, 1, 1};
      pushed += push_out(ObstacleSetView{&tree, 1}, low, high, before, x) ? 1 : 0;
      push_out(ObstacleSetView{&dense, 1}, low, high, before, y);
      ASSERT_TRUE(x == y) << i;
    }
    EXPECT_GT(pushed, 20) << word_of(shape);
  }
}

TEST(DenseValues, AHugeBoxHasNone) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.4, 0.5})});
  LevelSetGrid level_set = build_level_set(scene, scene.obstacles[0], "obstacle");
  DenseValues box{};
  EXPECT_TRUE(dense_values(level_set, 1e-4, box).empty());
}

}  // namespace
}  // namespace graupel::sparsegrid
