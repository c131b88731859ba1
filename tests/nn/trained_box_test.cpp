// What weights files say of their training's scenes.
#include "nn/trained_box.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"

namespace graupel::nn {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Scene sand_of(double friction_angle, double wall_friction) {
  Scene scene;
  scene.materials["dune"].model = MaterialModel::sand;
  scene.materials["dune"].friction_angle = friction_angle;
  scene.materials["spare"].model = MaterialModel::metal;  // of no body
  scene.sources.emplace_back().material = "dune";
  scene.domain.wall_friction = wall_friction;
  return scene;
}

TEST(TrainedBox, HoldsWhatItWasWidenedBy) {
  TrainedBox box;
  EXPECT_FALSE(box.is_told());
  EXPECT_THAT(box.unlike_materials(sand_of(30, 0)), IsEmpty());
  box.widen(sand_of(20, 0.1));
  box.widen(sand_of(45, 0.7));
  EXPECT_TRUE(box.is_told());
  EXPECT_EQ(box.ranges.at("sand.friction_angle"), std::make_pair(20.0, 45.0));
  EXPECT_FALSE(box.ranges.contains("sand.viscosity"));  // of water alone
  EXPECT_FALSE(box.ranges.contains("metal.yield_stress"));
  EXPECT_THAT(box.unlike_materials(sand_of(30, 0)), IsEmpty());
  EXPECT_THAT(box.unlike_contacts(sand_of(50, 0.4)), IsEmpty());
  EXPECT_THAT(box.unlike_materials(sand_of(50, 0.4)), Contains("sand.friction_angle is 50, of the training 20 to 45"));
  EXPECT_THAT(box.unlike_contacts(sand_of(30, 0.9)), Contains("contact.friction is 0.9, of the training 0.1 to 0.7"));
  Scene other = sand_of(30, 0.4);
  other.materials["dune"].model = MaterialModel::snow;
  other.domain.walls = Contact::stick;
  EXPECT_THAT(box.unlike_materials(other), Contains("snow.hardening is 10; the training had no such constant"));
  EXPECT_THAT(box.unlike_contacts(other), Contains("contact is stick, of the training separate"));
}

TEST(TrainedBox, IsInTheMetadata) {
  TrainedBox box;
  Scene poured = sand_of(20.5, 0.1);
  poured.emitters.emplace_back();
  box.widen(poured);
  Weights weights;
  weights.file = "net.safetensors";
  EXPECT_FALSE(TrainedBox::load(weights).is_told());
  box.store(weights.metadata);
  const TrainedBox again = TrainedBox::load(weights);
  EXPECT_EQ(again.ranges, box.ranges);
  EXPECT_EQ(again.contacts, box.contacts);
  EXPECT_EQ(again.changes, (std::set<std::string>{"particles that come or go"}));
  EXPECT_TRUE(again.unlike_changes(poured).empty());
  poured.obstacles.emplace_back().motion = Motion{};
  EXPECT_THAT(again.unlike_changes(poured), ElementsAre("the training had no scene with moving obstacles"));
  weights.metadata["training.ranges"] = R"({"sand.friction_angle": "steep"})";
  try {
    TrainedBox::load(weights);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'net.safetensors': metadata key 'training.ranges'"));
  }
}

}  // namespace
}  // namespace graupel::nn
