// Rollouts of many scenes by one call: on a CPU, and what decides who runs together on a GPU.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/system/error.h"
#include "graph/rollout_parts.h"
#include "tests/graph/cuda/simulator_case.h"
#include "tests/graph/many_scenes.h"

namespace graupel::graph {
namespace {

class RolloutMany : public ::testing::Test {
 protected:
  RolloutMany() {
    HgnConfig config = small_config();
    config.history = 5;
    simulator_.emplace(file_.read_back(random_weights(config, wide_statistics())));
    options_.frames = 3;
  }
  WeightsFile file_;
  std::optional<LearnedSimulator> simulator_;
  LearnedSimulator::RolloutOptions options_;
};

TEST_F(RolloutMany, GivesEachSceneWhatItHasAloneInTheirOrder) {
  ManyScenes scenes;
  for (const int particles : {40, 90, 7}) scenes.add(clouds_at_a_ball(particles), options_);
  std::vector<std::size_t> order;
  const auto results = scenes.run(*simulator_, {}, &order);
  EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2}));
  scenes.expect_as_alone(*simulator_, results);
  for (const auto& result : results) EXPECT_EQ(result.alone, "scenes run one after the other on a CPU");
}

TEST_F(RolloutMany, ASceneThatDivergesStopsAlone) {
  ManyScenes scenes;
  scenes.add(clouds_at_a_ball(30), options_);
  scenes.add(moving_by(clouds_at_a_ball(30), {1.5f, 0, 0}), options_);  // more than the domain's edge a frame
  scenes.add(clouds_at_a_ball(30), options_);
  const auto results = scenes.run(*simulator_);
  EXPECT_EQ(results[1].trajectory.diverged_at_frame, 1);
  EXPECT_EQ(results[1].trajectory.frame_count(), 1u);
  for (const std::size_t i : {0, 2}) EXPECT_EQ(results[i].trajectory.frame_count(), 4u);
}

/// Before any scene is run.
TEST_F(RolloutMany, ErrorsNameTheScene) {
  const auto expect_named = [&](const ManyScenes& scenes, const std::string& text) {
    int results = 0;
    try {
      simulator_->rollout_many(scenes.list(), [&](LearnedSimulator::SceneResult&&) { ++results; }, {});
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("scene 1 'second': " + text), std::string::npos) << error.what();
    }
    EXPECT_EQ(results, 0);
  };
  const auto scenes_with = [&](const Case& second) {
    ManyScenes scenes;
    scenes.add(clouds_at_a_ball(30), options_);
    scenes.add(second, options_, "second");
    return scenes;
  };
  Case c = clouds_at_a_ball(30);
  c.scene.frame_time = 0.5;
  expect_named(scenes_with(c), "the network was trained for another frame time");
  c = clouds_at_a_ball(30);
  c.history.back()[3][1] = NAN;
  expect_named(scenes_with(c), "a start position is not finite");
  c = clouds_at_a_ball(30);
  c.type[4] = 12;
  expect_named(scenes_with(c), "");
}

TEST_F(RolloutMany, ErrorsWithinARolloutNameTheScene) {
  ManyScenes scenes;
  scenes.add(clouds_at_a_ball(30), options_);
  scenes.add(clouds_at_a_ball(30), options_, "far");
  const std::vector<std::vector<Vec3f>> other(3, std::vector<Vec3f>(7));  // places of another number of particles
  LearnedSimulator::SceneRollout far = scenes.list()[1];
  far.options.given = &other;
  std::vector<std::size_t> results;
  try {
    simulator_->rollout_many({scenes.list()[0], far},
                             [&](LearnedSimulator::SceneResult&& result) { results.push_back(result.scene); }, {});
    ADD_FAILURE() << "no error";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find("scene 1 'far': a frame that gives the places"), 0u) << error.what();
  }
  EXPECT_EQ(results, (std::vector<std::size_t>{0}));
}

TEST_F(RolloutMany, ProgressEndsWithTheLastFrame) {
  ManyScenes scenes;
  for (const int particles : {40, 7}) scenes.add(clouds_at_a_ball(particles), options_);
  std::vector<int64_t> frames;
  scenes.run(*simulator_, {.progress = [&](int64_t frame) { frames.push_back(frame); }});
  EXPECT_EQ(frames, (std::vector<int64_t>{1, 2, 3, 1, 2, 3}));
}

TEST_F(RolloutMany, GoesOnAfterAnException) {
  ManyScenes scenes;
  for (const int particles : {40, 90}) scenes.add(clouds_at_a_ball(particles), options_);
  scenes.expect_to_go_on_after_an_exception(*simulator_, file_.read_back(simulator_->weights()));
}

TEST(WhatChanges, NamesWhatAGpuDoesNotRunWhole) {
  const Case c = clouds_at_a_ball(4);
  EXPECT_EQ(what_changes(Environment(c.scene)), "");
  Scene moving = c.scene;
  moving.obstacles[0].motion.emplace().velocity = {1, 0, 0};
  EXPECT_EQ(what_changes(Environment(moving)), "its obstacles move");
  const Environment environment(c.scene);
  const ParticleLifecycle lifecycle(c.scene, nullptr, c.history.back(), {}, 0);
  std::vector<int32_t> type = c.type;
  EXPECT_EQ(what_changes(environment, PrescribedPositions(type, c.history.back(), nullptr), lifecycle), "");
  type[2] = particle_type_of(MaterialModel::stationary);
  EXPECT_EQ(what_changes(environment, PrescribedPositions(type, c.history.back(), nullptr), lifecycle),
            "it has kinematic particles");
}

}  // namespace
}  // namespace graupel::graph
