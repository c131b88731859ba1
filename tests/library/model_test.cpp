// Learned and reduced models through the public headers, with the shipped weights.
#include <graupel/graph.h>
#include <graupel/io.h>
#include <graupel/mpm.h>
#include <graupel/rom.h>
#include <gtest/gtest.h>

#include <cmath>

namespace graupel {
namespace {

const std::string root = GRAUPEL_SOURCE_DIR;

TEST(PublicNetwork, RollsOutAScene) {
  const Scene scene = io::read_scene(root + "/scenes/shared/water_steps.json");
  const NetworkModel network(root + "/models/hgn.safetensors");
  int64_t last = 0;
  const Trajectory run = network.rollout(scene, {.frames = 4, .progress = [&](int64_t frame) { last = frame; }});
  ASSERT_EQ(run.frame_count(), 5u);
  EXPECT_EQ(last, 4);
  EXPECT_EQ(run.diverged_at_frame, -1);
  EXPECT_FALSE(run.scene_json.empty());
  // Free fall: the truth has the same particles, in the same order.
  Simulation truth(scene);
  ASSERT_EQ(truth.particle_count(), run.particle_count());
  EXPECT_EQ(truth.position()[3], run.frames[0].position[3]);
  for (int frame = 0; frame < 4; ++frame) truth.advance_frame();
  double mean = 0;
  for (std::size_t i = 0; i < run.particle_count(); ++i)
    mean += norm(truth.position()[i] - run.frames[4].position[i]) / static_cast<double>(run.particle_count());
  EXPECT_LT(mean, 1e-3);
}

TEST(PublicNetwork, SaysWhatItWasNotTrainedOn) {
  const NetworkModel network(root + "/models/hgn.safetensors");
  const Scene known = io::read_scene(root + "/scenes/shared/water_steps.json");
  EXPECT_TRUE(network.remarks(known).empty());
  const Scene jelly = io::read_scene(root + "/scenes/shared/water_steps.json", {"materials.water.bulk_modulus=5e5"});
  EXPECT_FALSE(network.remarks(jelly).empty());
}

TEST(PublicNetwork, ErrorsAreByKind) {
  EXPECT_THROW(NetworkModel("no_such.safetensors"), InputError);
  EXPECT_THROW(NetworkModel(root + "/models/nsf-jelly.safetensors"), InputError);
  const NetworkModel network(root + "/models/hgn.safetensors");
  const Scene slow = io::read_scene(root + "/scenes/shared/water_steps.json", {"frame_time=0.1"});
  EXPECT_THROW(network.rollout(slow, {.frames = 1}), ConfigError);
}

TEST(PublicReducedModel, RunsTheSceneOfItsTraining) {
  const ReducedModel model(root + "/models/nsf-jelly.safetensors");
  ASSERT_EQ(model.parameters().size(), 1u);
  EXPECT_LT(model.parameters()[0].low, model.parameters()[0].high);
  const Scene scene = model.scene();
  EXPECT_TRUE(model.remarks(scene).empty());
  ReducedSimulation run(model, scene);
  Simulation truth(scene);
  ASSERT_EQ(run.particle_count(), truth.particle_count());
  double error = 0, moved = 0;
  const std::vector<Vec3f> start(truth.position().begin(), truth.position().end());
  for (int frame = 0; frame < 20; ++frame) run.advance_frame(), truth.advance_frame();
  for (std::size_t i = 0; i < start.size(); ++i) {
    error += norm2(run.position()[i] - truth.position()[i]);
    moved += norm2(truth.position()[i] - start[i]);
  }
  EXPECT_LT(std::sqrt(error / moved), 0.1);
  EXPECT_EQ(run.verdict(), "ok");
  EXPECT_GT(run.trust_number(), 0);
  EXPECT_EQ(run.header().particle_type.size(), run.frame().position.size());
  EXPECT_NEAR(run.time(), 20 * scene.frame_time, 1e-9);
}

TEST(PublicReducedModel, ForeignScenesAndFilesAreRefused) {
  EXPECT_THROW(ReducedModel(root + "/models/hgn.safetensors"), InputError);
  const ReducedModel model(root + "/models/nsf-jelly.safetensors");
  EXPECT_THROW(ReducedSimulation(model, io::read_scene(root + "/scenes/shared/water_steps.json")), ConfigError);
  Scene fast = io::parse_scene(io::scene_to_json(model.scene()), "fast", ".",
                               {model.parameters()[0].keys[0] + "=" + std::to_string(2 * model.parameters()[0].high)});
  EXPECT_EQ(model.remarks(fast).size(), 1u);
}

}  // namespace
}  // namespace graupel
