#include <gtest/gtest.h>

#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

TEST(SceneVariants, CoarseKeepsTheWallsAndTakesAnEighthOfTheParticles) {
  Scene scene = scene_with("water", {0.5, 0.5, 0.5}, 0.25);
  for (const int64_t wall_cells : {2, 3, 4, 5}) {
    scene.domain.wall_cells = wall_cells;
    const Scene coarse = coarse_variant(scene);
    EXPECT_DOUBLE_EQ(coarse.domain.dx, 1.0 / 32);
    EXPECT_GE(coarse.domain.wall_cells, 2);
    EXPECT_LT(norm(coarse.wall_low() - scene.wall_low()), 1e-12);
    EXPECT_LT(norm(coarse.wall_high() - scene.wall_high()), 1e-12);
    EXPECT_DOUBLE_EQ(coarse.voxel(), scene.voxel());
  }
  const double n = static_cast<double>(Simulation::create(scene, {})->particle_count());
  EXPECT_NEAR(static_cast<double>(Simulation::create(coarse_variant(scene), {})->particle_count()), n / 8, 2);
}

TEST(SceneVariants, CoarseMovesTheBodyAlike) {
  const Scene scene = scene_with("sand", {0.5, 0.12, 0.5});
  Vec3d centre[2];
  int i = 0;
  for (const Scene& variant : {scene, coarse_variant(scene)}) {
    const auto sim = Simulation::create(variant, {});
    for (int f = 0; f < 10; ++f) sim->advance_frame();
    Vec3d sum = {0, 0, 0};
    for (const Vec3f& x : sim->frame().position) sum += x.cast<double>();
    centre[i++] = sum * (1 / static_cast<double>(sim->particle_count()));
  }
  EXPECT_LT(norm(centre[1] - centre[0]), scene.domain.dx);
}

}  // namespace
}  // namespace graupel::mpm
