// Scenes drawn from recipes: groups cut in halves of two materials are whole groups otherwise, and what hgn_large.json
// promises.
#include "mpm/scene/scene_recipe.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/system/error.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "mpm/scene/placement.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {
namespace {

SceneRecipe recipe(const std::string& name, const std::vector<std::string>& set = {}) {
  return io::read_recipe(std::string(GRAUPEL_SOURCE_DIR) + "/scenes/recipes/" + name, set);
}

bool is_half(const Source& source) { return source.shape == Shape::half_box || source.shape == Shape::half_sphere; }

Source whole_of(const Source& half) {
  Source whole = half;
  whole.shape = half.shape == Shape::half_box ? Shape::box : Shape::sphere;
  return whole;
}

/// Both halves of every group of a scene lie in the whole body, on two sides of a plane through its centre, and have as
/// many particles as it.
TEST(SceneRecipe, TwoHalvesAreAGroup) {
  const Scene scene = draw_scene(
      recipe("hgn_large.json", {"groups.mixed_share=1", "groups.count=12", "obstacles.count=0"}), 7, Split::train, 0);
  ASSERT_EQ(scene.sources.size(), 24u);
  const SampledParticles particles = sample_sources(scene, 3);
  std::set<int> axes;
  for (std::size_t s = 0; s < scene.sources.size(); s += 2) {
    const Source &first = scene.sources[s], &second = scene.sources[s + 1];
    ASSERT_TRUE(is_half(first) && is_half(second));
    EXPECT_EQ(first.position, second.position);
    EXPECT_EQ(first.velocity, second.velocity);
    EXPECT_NE(first.material, second.material);
    const Source whole = whole_of(first);
    Vec3d mean[2] = {Vec3d::zero(), Vec3d::zero()};
    double count[2] = {0, 0};
    for (std::size_t p = 0; p < particles.position.size(); ++p) {
      const int side = particles.source[p] - static_cast<int>(s);
      if (side != 0 && side != 1) continue;
      const Vec3d x = whole.to_local(particles.position[p]);
      EXPECT_LT(sparsegrid::analytic_distance(whole, x), 1e-9);
      mean[side] += x;
      ++count[side];
    }
    const Vec3d apart = mean[0] * (1 / count[0]) - mean[1] * (1 / count[1]);
    const double size = 0.08, dx = scene.domain.dx;
    const double volume = whole.shape == Shape::box ? size * size * size : M_PI / 6 * size * size * size;
    EXPECT_NEAR(count[0] + count[1], 8 * volume / (dx * dx * dx), 0.01 * (count[0] + count[1]));
    EXPECT_NEAR(count[0], count[1], 0.01 * count[0]);
    // Centroids of half bodies of radius r lie at r / 2 (box) and 3/8 r (ball) from the cut, in the body's frame along
    // y.
    EXPECT_NEAR(std::abs(apart[1]), size / 2 * (whole.shape == Shape::box ? 1 : 0.75), 0.05 * size);
    EXPECT_NEAR(apart[0], 0, 0.1 * size);
    EXPECT_NEAR(apart[2], 0, 0.1 * size);
    axes.insert(first.rotation_angle == 0 ? 1 : first.rotation_axis[0] == 1 ? 2 : 0);
  }
  EXPECT_EQ(axes.size(), 3u);
}

TEST(SceneRecipe, TheShareOfMixedGroupsIsAskedFor) {
  const SceneRecipe half = recipe("hgn_large.json", {"obstacles.count=0"});
  double mixed = 0, groups = 0, speed = 0;
  for (int64_t i = 0; i < 8; ++i)
    for (const Source& source : draw_scene(half, 1, Split::train, i).sources) {
      groups += is_half(source) ? 0.5 : 1;
      mixed += is_half(source) ? 0.5 : 0;
      EXPECT_LE(norm(source.velocity), 4 + 1e-9);
      speed += norm(source.velocity) * (is_half(source) ? 0.5 : 1);
    }
  EXPECT_EQ(groups, 8 * 46);
  EXPECT_NEAR(mixed / groups, 0.5, 0.1);  // four standard deviations
  EXPECT_NEAR(speed / groups, 2, 0.25);
}

/// Ten times the 3,800 particles of a scene of hgn.json, in a tenth of its 800 scenes.
TEST(SceneRecipe, LargeScenesHaveTenTimesTheParticlesInATenthOfTheScenes) {
  const SceneRecipe large = recipe("hgn_large.json"), small = recipe("hgn.json");
  EXPECT_EQ(10 * large.counts.train, small.counts.train);
  EXPECT_EQ(large.obstacles.count, 10 * small.obstacles.count);
  const Vec3d floor = large.domain.wall_high() - large.domain.wall_low(),
              small_floor = small.domain.wall_high() - small.domain.wall_low();
  EXPECT_NEAR(floor[0] * floor[2], 10 * small_floor[0] * small_floor[2], 0.5 * small_floor[0] * small_floor[2]);
  double particles = 0;
  for (int64_t i = 0; i < 4; ++i) {
    const Scene scene = draw_scene(large, 5, Split::train, i);
    EXPECT_EQ(scene.obstacles.size(), 50u);
    particles += static_cast<double>(sample_sources(scene, scene.seed).position.size()) / 4;
  }
  EXPECT_NEAR(particles, 38000, 3000);
}

TEST(SceneRecipe, ASeedGivesOneScene) {
  const SceneRecipe large = recipe("hgn_large.json", {"groups.count=10", "obstacles.count=6"});
  const auto text = [&](uint64_t seed, int64_t index) {
    return io::scene_to_json(draw_scene(large, seed, Split::test, index));
  };
  EXPECT_EQ(text(4, 0), text(4, 0));
  EXPECT_NE(text(4, 0), text(5, 0));
  EXPECT_NE(text(4, 0), text(4, 1));
}

TEST(SceneRecipe, DrawsAreCounted) {
  int64_t left = 450;
  int drawn = 0;
  const auto draw = [&] { return ++drawn; };
  EXPECT_TRUE(place(
      draw, [](int number) { return number == 50; }, left));
  EXPECT_EQ(left, 401);
  EXPECT_FALSE(place(
      draw, [](int) { return false; }, left));
  EXPECT_EQ(left, 201) << "200 draws a body";
  EXPECT_FALSE(place(
      draw, [](int) { return false; }, left));
  EXPECT_FALSE(place(
      draw, [](int) { return false; }, left));
  EXPECT_TRUE(left == 0 && drawn == 451) << drawn;
}

TEST(SceneRecipe, RefusesToMixWhatCannotBeMixed) {
  EXPECT_THROW(recipe("hgn_large.json", {"groups.materials=[\"sand\"]"}), ConfigError);
  EXPECT_THROW(
      draw_scene(recipe("hgn_large.json", {"groups.shapes=[\"cone\"]", "groups.mixed_share=1"}), 1, Split::train, 0),
      ConfigError);
}

}  // namespace
}  // namespace graupel::mpm
