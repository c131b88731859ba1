// What the validation cases measure with, and that a plane case is one.
#include "validation/setup.h"

#include <gtest/gtest.h>

#include "core/system/error.h"

namespace graupel::validation {
namespace {

TEST(Setup, LinesAndCrossingsAreThoseOfTheirPoints) {
  const Line line = fit_line({0, 1, 2, 3}, {1, 3, 5, 7});
  EXPECT_NEAR(line.slope, 2, 1e-14);
  EXPECT_NEAR(line.offset, 1, 1e-14);
  EXPECT_DOUBLE_EQ(interpolated({0, 1, 3}, {0, 2, 0}, 2), 1);
  const std::vector<double> zeros = zero_crossings({0, 1, 2, 3, 4}, {1, 3, -1, -1, 1});
  ASSERT_EQ(zeros.size(), 2u);
  EXPECT_DOUBLE_EQ(zeros[0], 1.75);
  EXPECT_DOUBLE_EQ(zeros[1], 3.5);
}

TEST(Setup, LatticesFillTheirBoxWithTheMassOfItsMaterial) {
  Scene scene = plane_scene(0.1, {0, 0}, {1, 1});
  EXPECT_NEAR(norm(scene.wall_low() - Vec3d{0, 0, -0.5}), 0, 1e-15);
  EXPECT_NEAR(norm(scene.wall_high() - Vec3d{1, 1, 0.5}), 0, 1e-15);
  scene.materials["m"] = elastic(1e4, 0.3, 1000);
  const std::vector<Vec2d> points = plane_lattice(scene, {0.2, 0.2}, {0.7, 0.5}, 2);
  ASSERT_EQ(points.size(), 60u);
  EXPECT_NEAR(points[0][0], 0.225, 1e-15);
  add_plane_points(scene, "m", points, 2);
  EXPECT_NEAR(start(scene)->diagnostics().mass, 1000 * 0.5 * 0.3 * plane_depth, 1e-11);
  EXPECT_EQ(turned_lattice(scene, {0, 0}, {0.6, 0.8}, {0.5, 0.3}, 2).size(), 60u);
}

TEST(Setup, NothingMovesAcrossAPlane) {
  Scene scene = plane_scene(0.1, {0, 0}, {1, 1});
  scene.gravity = {0, -9.8, 0};
  scene.materials["m"] = elastic(1e4, 0.3, 1000);
  add_plane_points(scene, "m", plane_lattice(scene, {0.2, 0.1}, {0.7, 0.5}, 2), 2);
  scene.sources[0].velocity = {0.3, -0.5, 0};
  set_time(scene, 0.2, 4);
  const auto solver = start(scene);
  double largest_stress = 0;
  run_frames(*solver, scene, {}, [&] {
    const Particles p = particles_of(*solver);
    for (std::size_t i = 0; i < p.size(); ++i) {
      ASSERT_EQ(p.velocity[i][2], 0);
      for (int d = 0; d < 3; ++d) {
        ASSERT_EQ(p.affine_velocity[i](2, d), 0);
        ASSERT_EQ(p.affine_velocity[i](d, 2), 0);
      }
      largest_stress = std::max(largest_stress, std::abs(p.stress[i][2]));
    }
  });
  EXPECT_GT(largest_stress, 10);  // it carries stress across the plane, as plane strain does
}

TEST(Setup, AnUnknownPresetIsRefused) { EXPECT_THROW(preset("watter"), ConfigError); }

}  // namespace
}  // namespace graupel::validation
