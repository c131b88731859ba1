#include "mpm/scene_variants.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "core/system/error.h"
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

TEST(SceneVariants, WordsAndVariantsAreOneToOne) {
  for (const SolverVariant& variant : {same_solver, fast_solver, coarse_solver, coarse_fast_solver, fine_solver})
    EXPECT_EQ(parse_variant(variant_word(variant)), variant);
  EXPECT_EQ(parse_variant("mpm:coarse:fast")->resolution, 2);
  EXPECT_EQ(parse_variant("mpm:coarse:fast")->step, StepRule::largest_stable);
  for (const char* word : {"", "mpm:", "mpm:slow", "mpm:fine:fast", "mpm:fast:coarse"})
    EXPECT_FALSE(parse_variant(word)) << word;
}

TEST(SceneVariants, FineKeepsTheWallsAndTakesEightTimesTheParticles) {
  Scene scene = scene_with("water", {0.5, 0.5, 0.5}, 0.25);
  const Scene fine = variant_scene(scene, fine_solver);
  EXPECT_DOUBLE_EQ(fine.domain.dx, scene.domain.dx / 2);
  EXPECT_LT(norm(fine.wall_low() - scene.wall_low()), 1e-12);
  EXPECT_LT(norm(fine.wall_high() - scene.wall_high()), 1e-12);
  EXPECT_DOUBLE_EQ(fine.voxel(), scene.voxel());
  EXPECT_EQ(fine.time_step.substeps_per_frame, 2 * scene.time_step.substeps_per_frame);
  const auto n = static_cast<double>(sample_sources(scene, 1).position.size());
  EXPECT_NEAR(static_cast<double>(sample_sources(fine, 1).position.size()), 8 * n, 0.02 * 8 * n);
}

TEST(SceneVariants, FineKeepsTheMassAndTheCentreOfGivenPoints) {
  Scene scene = scene_with("water", {0.5, 0.5, 0.5}, 0.25);
  Source& source = scene.sources[0];
  source.shape = Shape::points;
  source.points = std::make_shared<const std::vector<Vec3d>>(std::vector<Vec3d>{{0, 0, 0}, {0.02, 0.01, 0}});
  const auto before = sample_sources(scene, 1), after = sample_sources(fine_variant(scene), 1);
  ASSERT_EQ(after.position.size(), 16u);
  double volume = 0;
  Vec3d centre = {0, 0, 0};
  for (std::size_t i = 0; i < 16; ++i) {
    volume += after.volume[i];
    if (i < 8) centre += after.position[i] * (1.0 / 8);
  }
  EXPECT_NEAR(volume, before.volume[0] + before.volume[1], 1e-15);
  EXPECT_LT(norm(centre - before.position[0]), 1e-12);
  const double fine_distance = scene.domain.dx / 2 / 2;  // between eight particles a cell of dx/2
  EXPECT_NEAR(norm(after.position[1] - after.position[0]), fine_distance, 1e-12);
}

/// Volume that an emitter sends out in a scene [m^3].
double emitted(const Scene& scene) {
  const SampledParticles particles = sample_sources(scene, 1);
  double volume = 0;
  for (std::size_t i = 0; i < particles.volume.size(); ++i)
    if (static_cast<std::size_t>(particles.source[i]) >= scene.sources.size()) volume += particles.volume[i];
  return volume;
}

TEST(SceneVariants, StreamsKeepTheirFluxOnEveryGrid) {
  for (const bool plane : {false, true})
    for (const double width : {0.05, 0.083, 0.12})
      for (const std::optional<double>& rate : {std::optional<double>(), std::optional<double>(plane ? 900 : 4000)}) {
        Scene scene = scene_with("water", {0.2, 0.2, 0.5});
        if (plane) scene = in_the_plane(scene);
        Emitter emitter;
        emitter.shape = plane ? Shape::box : Shape::cylinder;
        emitter.size = {width, 0.03, 0.5};
        emitter.radius = width / 2;
        emitter.height = 0.03;
        emitter.position = {0.6, 0.7, 0.5};
        emitter.material = "water";
        emitter.velocity = {0, -2, 0};
        emitter.rate = rate;
        emitter.end_time = 1;
        scene.emitters.push_back(emitter);
        const double expected = emitted(scene);
        EXPECT_NEAR(emitted(coarse_variant(scene)) / expected, 1, 0.03) << width;
        EXPECT_NEAR(emitted(fine_variant(scene)) / expected, 1, 0.03) << width;
        for (const double ratio : {1.25, 1.5, 2.0, 3.0}) {
          const Scene coarse = on_coarser_grid(scene, ratio);
          EXPECT_NEAR(emitted(coarse) / expected, 1, 0.04) << width << " " << ratio;
          EXPECT_LE(coarse.emitters[0].particles_per_cell, 2 * emitter.particles_per_cell) << width << " " << ratio;
          if (ratio < 1.5) continue;
          const Scene fewer = on_coarser_grid(scene, ratio, 0.6);
          EXPECT_NEAR(emitted(fewer) / expected, 1, 0.05) << width << " " << ratio;
          EXPECT_LT(fewer.emitters[0].particles_per_cell, coarse.emitters[0].particles_per_cell);
        }
      }
}

TEST(SceneVariants, CellsBetweenPeriodicWallsStayWhole) {
  Scene scene = scene_with("water");
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{.kind = Wall::periodic, .friction = {}};
  for (const int64_t wall_cells : {2, 3}) {
    scene.domain.wall_cells = wall_cells;
    for (const double ratio : {1.5, 2.0}) {
      const Scene coarse = on_coarser_grid(scene, ratio);
      EXPECT_NO_THROW(Simulation::create(coarse, {}));
      EXPECT_NEAR(coarse.domain.dx / scene.domain.dx, ratio, 0.05 * ratio);
      EXPECT_LT(norm(coarse.wall_low() - scene.wall_low()), 1e-12);
    }
  }
}

TEST(SceneVariants, PointsOfAScriptedSourceTurnAboutTheSameCentre) {
  Scene scene = scene_with("water");
  scene.sources[0].motion.emplace();
  scene.sources[0].motion->spin = 1;
  const Scene points = scene_of_points(scene, {{{0.5, 0.5, 0.5}}});
  EXPECT_EQ(points.sources[0].motion->center, scene.sources[0].position);
}

TEST(SceneVariants, WhatDoesNotFitIsRefusedWithNeedAndRemedy) {
  const Scene scene = scene_with("water", {0.5, 0.5, 0.5}, 0.25);
  const uint64_t plenty = uint64_t(1) << 60;
  EXPECT_NO_THROW(check_variant_fits(scene, fine_solver, {}, 1000, plenty, plenty));
  EXPECT_THAT([&] { check_variant_fits(scene, fine_solver, {}, 0, 1000000, plenty); },
              ::testing::ThrowsMessage<ConfigError>(
                  ::testing::AllOf(::testing::HasSubstr("'mpm:fine'"), ::testing::HasSubstr("GB needed"),
                                   ::testing::HasSubstr("0.001 GB available"), ::testing::HasSubstr("Leave it out"))));
  EXPECT_THROW(check_variant_fits(scene, fine_solver, {}, 1e12, uint64_t(1) << 40, plenty), ConfigError);  // frames
  SimulationOptions gpu;
  gpu.device = Device::cuda;
  EXPECT_THAT([&] { check_variant_fits(scene, fine_solver, gpu, 0, plenty, 1000); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("memory of the GPU")));
}

}  // namespace
}  // namespace graupel::mpm
