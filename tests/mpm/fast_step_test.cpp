// The search for the largest stable step: it holds, one substep fewer does not, and it is the same every time.
#include "mpm/fast_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr int64_t frames = 8;

/// A cube that hits the floor within the first frames.
Scene dropped(const std::string& material) {
  Scene scene = scene_with(material, {0.5, 0.16, 0.5});
  scene.domain.dx = 1.0 / 32;
  scene.sources[0].velocity = {0, -2, 0};
  return scene;
}

/// Kinetic + elastic energy after each frame [J]; shorter than `frames` when the run blows up.
std::vector<double> energies(Scene scene, int64_t substeps) {
  scene.time_step.substeps_per_frame = substeps;
  const auto simulation = Simulation::create(scene, {});
  std::vector<double> energy;
  try {
    for (int64_t f = 0; f < frames; ++f) {
      simulation->advance_frame();
      const Diagnostics d = simulation->diagnostics();
      energy.push_back(d.kinetic_energy + d.elastic_energy);
    }
  } catch (const DivergedError&) {
    return energy;
  }
  return energy;
}

bool runs_alike(const std::vector<double>& own, const std::vector<double>& other) {
  if (other.size() < own.size()) return false;
  const double largest = *std::max_element(own.begin(), own.end());
  for (std::size_t f = 0; f < own.size(); ++f)
    if (!(std::abs(own[f] - other[f]) <= fast_step_energy * largest)) return false;
  return true;
}

class FastSteps : public ::testing::Test {
 protected:
  void SetUp() override { set_num_threads(1); }  // a second thread costs these small scenes more than it brings
  void TearDown() override { set_num_threads(0); }
};

TEST_F(FastSteps, HoldWhileOneSubstepFewerDoesNot) {
  for (const char* material : {"taichi_water", "taichi_sand", "taichi_snow"}) {
    const Scene scene = dropped(material);
    const FastStep step = find_fast_step(scene, {}, frames);
    EXPECT_EQ(step.data_substeps, 54) << material;
    EXPECT_LT(step.substeps, 54) << material;
    EXPECT_LE(step.trials, 8) << material;
    EXPECT_EQ(step.scene.time_step.policy, StepPolicy::fixed);
    EXPECT_EQ(step.scene.time_step.substeps_per_frame, step.substeps);
    const auto own = energies(scene, 54);
    EXPECT_TRUE(runs_alike(own, energies(scene, step.substeps))) << material;
    EXPECT_FALSE(runs_alike(own, energies(scene, step.substeps - 1))) << material;
  }
}

TEST_F(FastSteps, AreTheSameEveryTime) {
  const Scene scene = dropped("taichi_sand");
  EXPECT_EQ(find_fast_step(scene, {}, frames).substeps, find_fast_step(scene, {}, frames).substeps);
}

TEST_F(FastSteps, AnAdaptiveSceneIsSearchedBelowItsOwnMean) {
  Scene scene = dropped("taichi_water");
  scene.time_step = {};
  const FastStep step = find_fast_step(scene, {}, frames);
  EXPECT_LE(step.substeps, step.data_substeps);
  EXPECT_EQ(step.scene.time_step.policy, step.substeps < step.data_substeps ? StepPolicy::fixed : StepPolicy::adaptive);
}

TEST_F(FastSteps, ASceneThatDoesNotRunIsRefused) {
  Scene scene = dropped("taichi_snow");
  scene.time_step.substeps_per_frame = 1;
  EXPECT_THROW(find_fast_step(scene, {}, frames), DivergedError);
}

TEST_F(FastSteps, ShorterStepsEndAtTheScenesOwn) {
  const Scene scene = dropped("taichi_sand");
  FastStep step{scene, 40, 54, 1, 0};
  std::vector<int64_t> tried;
  while (step.substeps < step.data_substeps) {
    step = shorter_step(step, scene);
    tried.push_back(step.scene.time_step.substeps_per_frame);
  }
  EXPECT_EQ(tried, (std::vector<int64_t>{45, 50, 54}));
}

TEST_F(FastSteps, AreShortEnoughForStreamsAndScripts) {
  Scene scene = scene_with("taichi_jelly", {0.3, 0.2, 0.5});
  scene.materials["taichi_jelly"].youngs_modulus = 500;  // its waves would go with a substep or two
  scene.domain.dx = 1.0 / 32;
  scene.gravity = Vec3d::zero();
  Obstacle box;
  box.shape = Shape::box;
  box.size = {0.05, 0.05, 0.05};
  box.position = {0.7, 0.2, 0.7};
  box.motion.emplace();
  box.motion->velocity = {0, 4, 0};  // 2.1 cells a frame
  box.motion->end_time = 0.1;
  scene.obstacles.push_back(box);
  EXPECT_EQ(find_fast_step(scene, {}, frames).substeps, 3);

  scene.obstacles.clear();
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.03, 0.1, 0.1};
  emitter.position = {0.2, 0.6, 0.5};
  emitter.material = "taichi_jelly";
  emitter.velocity = {6, 0, 0};  // 3.2 cells a frame
  emitter.start_time = 0.05;
  emitter.end_time = 0.08;
  scene.emitters.push_back(emitter);
  EXPECT_GE(find_fast_step(scene, {}, frames).substeps, 4);
  EXPECT_LT(find_fast_step(scene, {}, frames).substeps, 54);
}

TEST_F(FastSteps, IsInterruptedBetweenFrames) {
  int calls = 0;
  const auto stop = [&] {
    if (++calls == 3) throw Error(ExitCode::interrupted, "interrupted");
  };
  EXPECT_THROW(find_fast_step(dropped("taichi_sand"), {}, frames, stop), Error);
}

}  // namespace
}  // namespace graupel::mpm
