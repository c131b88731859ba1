// A recipe of categories from generate to rollouts: networks of the papers' form that see constants and contact, GNS
// with obstacles as particles too.
#include <gtest/gtest.h>

#include "io/trajectory/trajectory_file.h"
#include "nn/trained_box.h"
#include "nn/weights.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

class CategoryTraining : public testing::Test {
 protected:
  void SetUp() override {
    if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch)";
    const Outcome made = graupel(
        "generate scenes/recipes/general.json --set 'categories=[\"fall_on_obstacles\",\"dam_break\"]' --set frames=40 "
        "--set max_particles=400 --set 'obstacles.count=[3,5]' --set counts.train=2 --set counts.valid=2 --set "
        "counts.test=0 --set fields='' --device cpu --seed 11 -o " +
        data_);
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  /// Thirty steps by the preset of the papers; the bytes of the weights.
  std::string train(const std::string& network, const std::string& name, const std::string& more = "") {
    const std::string run = folder_.file(name), of = " --set " + network + ".";
    const Outcome trained =
        graupel("train " + network + " --preset paper --data " + data_ + " --out " + run +
                " --device cpu --threads 1 --steps 30 --set validation_samples=2 --set rollout_scenes=0" + of +
                "latent=16" + of + "message_passing=5" + of + "material_constants=true" + of + "contact=true" + more);
    EXPECT_EQ(trained.exit_code, 0) << trained.output;
    EXPECT_TRUE(trained.says("finished at step 30")) << trained.output;
    return run + "/weights.safetensors";
  }
  void expect_to_roll_out(const std::string& weights) {
    const std::string out = folder_.file("rollout.h5");
    const Outcome rolled = graupel("rollout " + weights + " " + data_ + "/train.h5 --frames 2 --device cpu -o " + out);
    ASSERT_EQ(rolled.exit_code, 0) << rolled.output;
    EXPECT_EQ(io::TrajectoryReader(out).header(0).frame_count(), 3u);
  }

  Folder folder_;
  std::string data_ = folder_.file("data");
};

TEST_F(CategoryTraining, OfHgnsInThePapersForm) {
  const std::string weights = train("hgn", "hgn");
  EXPECT_EQ(nn::read_safetensors(weights).metadata.at("hgn.aggregation"), "messages");
  expect_to_roll_out(weights);
}

TEST_F(CategoryTraining, OfGnsWithObstacleParticles) {
  const std::string with = train("gns", "with", " --set gns.obstacle_particles=true --set gns.obstacle_spacing=0.06");
  const nn::Weights weights = nn::read_safetensors(with);
  EXPECT_GE(nn::TrainedBox::load(weights).contacts.size(), 2u);
  expect_to_roll_out(with);
  const nn::Weights without = nn::read_safetensors(train("gns", "without"));
  ASSERT_TRUE(weights.tensors.contains("embedding.weight"));
  EXPECT_NE(weights.tensors.at("embedding.weight").as_float(), without.tensors.at("embedding.weight").as_float());
}

/// All eight categories of the recipe: streams, moving obstacles and containers that fill among them.
TEST(AllCategories, TrainOneNetwork) {
  if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch)";
  const Folder folder;
  const std::string data = folder.file("data"), run = folder.file("run");
  const Outcome made = graupel(
      "generate scenes/recipes/general.json --set frames=40 --set max_particles=400 --set counts.train=8 --set "
      "counts.valid=8 --set counts.test=0 --set fields='' --device cpu --seed 11 -o " +
      data);
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const Outcome trained = graupel(
      "train hgn --data " + data + " --out " + run +
      " --device cpu --threads 1 --steps 20 --set validation_samples=16 --set rollout_scenes=8 --set rollout_frames=39"
      " --set batch_scenes=8 --set hgn.latent=16 --set hgn.material_constants=true --set hgn.contact=true --set "
      "hgn.bundle=2 --set push_steps=1");
  ASSERT_EQ(trained.exit_code, 0) << trained.output;
  EXPECT_TRUE(trained.says("finished at step 20")) << trained.output;
  EXPECT_EQ(nn::TrainedBox::load(nn::read_safetensors(run + "/weights.safetensors")).changes,
            (std::set<std::string>{"moving obstacles", "particles that come or go"}));
  const Outcome rolled = graupel("rollout " + run + "/weights.safetensors " + data +
                                 "/valid.h5 --frames 2 --device cpu -o " + folder.file("rollout.h5"));
  EXPECT_EQ(rolled.exit_code, 0) << rolled.output;
}

}  // namespace
}  // namespace graupel::test
