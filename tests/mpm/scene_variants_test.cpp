#include <gtest/gtest.h>

#include "mpm/sampling.h"
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

TEST(SceneVariants, CoarseKeepsTheMassOfGivenPoints) {
  Scene scene = scene_with("water", {0.5, 0.5, 0.5}, 0.25);
  Source& source = scene.sources[0];
  source.shape = Shape::points;
  for (const int n : {1, 7, 8, 1000, 1003}) {
    auto points = std::make_shared<std::vector<Vec3d>>();
    for (int i = 0; i < n; ++i) points->push_back({1e-4 * (i - n / 2), 0, 0});
    source.points = points;
    const auto volume = [](const Scene& s) {
      double sum = 0;
      for (const double v : sample_sources(s, 1).volume) sum += v;
      return sum;
    };
    const Scene coarse = coarse_variant(scene);
    EXPECT_EQ(coarse.sources[0].points->size(), n < 12 ? 1u : 125u) << n;
    if (n >= 8) {
      EXPECT_NEAR(volume(coarse) / volume(scene), 1, 0.005) << n;
    }
    EXPECT_EQ(*coarse_variant(scene).sources[0].points, *coarse.sources[0].points);
    for (std::size_t i = 1; i < coarse.sources[0].points->size(); ++i)  // spread over all of them, none twice
      EXPECT_LT((*coarse.sources[0].points)[i - 1][0], (*coarse.sources[0].points)[i][0]);
  }
  Scene other = scene;
  other.seed = scene.seed + 1;
  EXPECT_NE(*coarse_variant(other).sources[0].points, *coarse_variant(scene).sources[0].points);
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
