#include "core/scene/checks/range_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "core/system/error.h"

namespace graupel {
namespace {

Scene scene_of_a_sphere() {
  Scene scene;
  scene.materials["water"] = *material_preset("water");
  scene.sources.emplace_back().shape = Shape::sphere;
  scene.obstacles.emplace_back().motion.emplace();
  return scene;
}

void expect_refused(const std::string& message, const std::function<void(Scene&)>& change) {
  Scene scene = scene_of_a_sphere();
  change(scene);
  try {
    check_ranges(scene);
    FAIL() << message;
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(message));
  }
}

TEST(RangeCheck, NamesWhatIsOutOfRange) {
  EXPECT_NO_THROW(check_ranges(scene_of_a_sphere()));
  expect_refused("frame_time is out of range (0, allowed > 0 and <= 1e+06). Change the value",
                 [](Scene& s) { s.frame_time = 0; });
  expect_refused("frames is out of range (-1, ", [](Scene& s) { s.frames = -1; });
  expect_refused("sources[0].particles_per_cell is out of range (-8, ",
                 [](Scene& s) { s.sources[0].particles_per_cell = -8; });
  expect_refused("sources[0].radius is out of range (-1, ", [](Scene& s) { s.sources[0].radius = -1; });
  expect_refused("gravity[1] is out of range (nan, ",
                 [](Scene& s) { s.gravity[1] = std::numeric_limits<double>::quiet_NaN(); });
  expect_refused("obstacles[0].position[2] is out of range (inf, allowed finite numbers)",
                 [](Scene& s) { s.obstacles[0].position[2] = std::numeric_limits<double>::infinity(); });
  expect_refused("obstacle_voxel is out of range", [](Scene& s) { s.obstacle_voxel = 0; });
  expect_refused("materials.water.", [](Scene& s) { s.materials["water"].density = -1; });
  expect_refused("time_step.substeps_per_frame is out of range (-3, ", [](Scene& s) {
    s.time_step.policy = StepPolicy::fixed;
    s.time_step.substeps_per_frame = -3;
  });
}

TEST(RangeCheck, LeavesOutWhatHasNoEffect) {
  Scene scene = scene_of_a_sphere();
  scene.sources[0].size = {-1, 0, 0};          // of boxes
  scene.time_step.substeps_per_frame = -3;     // of fixed steps
  scene.materials["water"].yield_stress = -1;  // of other models
  EXPECT_NO_THROW(check_ranges(scene));
}

}  // namespace
}  // namespace graupel
