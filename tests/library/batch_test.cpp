// Batches through the public header.
#include <graupel/batch.h>
#include <graupel/mpm.h>
#include <gtest/gtest.h>

#include "tests/library/test_scenes.h"

namespace graupel {
namespace {

using test::spinning_block;

TEST(PublicBatch, ScenesAreAsAlone) {
  const std::vector<Scene> scenes = {spinning_block("jelly"), spinning_block("sand"), spinning_block("jelly")};
  Batch batch(scenes, {.seeds = {1, 2, 3}});
  ASSERT_EQ(batch.size(), 3u);
  const std::shared_ptr<const ParticleFrame> start = batch.frame(1);
  EXPECT_EQ(start, batch.frame(1)) << "one copy a frame";
  batch.advance_frame();
  batch.advance_frame();
  EXPECT_EQ(batch.frames_done(), 2);
  EXPECT_FALSE(start->position == batch.frame(1)->position);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    Simulation alone(scenes[i], {.seed = i + 1});
    alone.advance_frame();
    alone.advance_frame();
    const ParticleFrame expected = alone.frame({ParticleField::stress});
    EXPECT_TRUE(batch.frame(i)->position == expected.position);
    EXPECT_TRUE(batch.frame(i, {ParticleField::stress})->fields == expected.fields);
    EXPECT_EQ(batch.on_device(i, ParticleQuantity::velocity).get()[5], expected.velocity[1][2]);
    EXPECT_EQ(alone.on_device(ParticleQuantity::velocity).get()[5], expected.velocity[1][2]);
    EXPECT_EQ(batch.particle_type(i)[0], alone.particle_type()[0]);
    EXPECT_FALSE(batch.divergence(i));
  }
  EXPECT_FALSE(batch.advance_frame([] { return true; }));
  EXPECT_EQ(batch.frames_done(), 2);
}

TEST(PublicBatch, ErrorsNameTheScene) {
  Scene scene = spinning_block("jelly");
  scene.name = "column";
  scene.sources[0].position = {0.24, 0.0, 0.24};
  try {
    Batch({spinning_block("jelly"), scene});
    FAIL() << "the source lies in the floor";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("scene 1 ('column'): ", 0), 0u) << error.what();
  }
  EXPECT_THROW(Batch({}), ConfigError);
  EXPECT_THROW(Batch({spinning_block("jelly")}, {.seeds = {1, 2}}), ConfigError);
  const Batch one({spinning_block("jelly")});
  EXPECT_THROW(one.scene(1), ConfigError);
  EXPECT_THROW(one.particle_type(3), ConfigError);
  EXPECT_THROW(one.divergence(300000), ConfigError);
  EXPECT_THROW(one.frame(1), ConfigError);
}

/// A step that is too long for a script is found when the solver is made.
TEST(PublicBatch, ErrorsOfTheSolverNameTheSceneToo) {
  Scene fast = spinning_block("jelly");
  fast.name = "fast";
  fast.time_step.substeps_per_frame = 1;
  Obstacle& ball = fast.obstacles.emplace_back();
  ball.shape = Shape::sphere;
  ball.radius = 0.03;
  ball.position = {0.1, 0.1, 0.1};
  ball.motion.emplace().velocity = {5, 0, 0};
  try {
    Batch({spinning_block("jelly"), fast});
    FAIL() << "the obstacle moves over cells in a step";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("scene 1 ('fast'): ", 0), 0u) << error.what();
  }
}

}  // namespace
}  // namespace graupel
