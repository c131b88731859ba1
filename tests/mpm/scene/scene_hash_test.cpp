#include "mpm/scene/scene_hash.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

TEST(SceneHash, KnowsEveryBitAndTheRoundedOneThirty) {
  const Scene scene = scene_with("taichi_snow", {0.5, 0.12, 0.5});
  const uint64_t exact = scene_hash(scene, 3), rounded = rounded_scene_hash(scene, 3);
  EXPECT_NE(rounded, rounded_scene_hash(scene, 4));
  const auto with = [&](double y, double z) {
    Scene other = scene;
    other.sources[0].position[1] = y;
    other.sources[0].velocity[2] = z;
    return other;
  };
  const Scene last_bit = with(std::nextafter(0.12, 1), 1e-17);
  EXPECT_NE(scene_hash(last_bit, 3), exact);
  EXPECT_EQ(rounded_scene_hash(last_bit, 3), rounded);
  EXPECT_NE(rounded_scene_hash(with(0.12 * (1 + 1e-8), 0), 3), rounded);
  EXPECT_NE(rounded_scene_hash(with(0.12, 1e-11), 3), rounded);
  EXPECT_NE(rounded_scene_hash(with(-0.12, 0), 3), rounded);
}

}  // namespace
}  // namespace graupel::mpm
