// Networks know materials by their type; a scene with others than those of the training is told of.
#include "experiments/models/trained_materials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "nn/trained_box.h"

namespace graupel::experiments {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Scene scene_with(const std::string& name, const std::string& material) {
  return io::parse_scene(R"({"domain": {"size": [1, 1, 1], "dx": 0.03125}, "materials": {")" + name + R"(": )" +
                             material +
                             R"(}, "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5],
                             "material": ")" +
                             name + R"("}]})",
                         "scene", ".");
}

nn::Weights taught(const std::string& materials) {
  nn::Weights weights;
  weights.file = "net.safetensors";
  weights.metadata["training.materials"] = materials;
  return weights;
}

TEST(TrainedMaterials, TellOfAnotherParameter) {
  const nn::Weights weights = taught(R"({"sand": {"preset": "taichi_sand"}, "water": {"preset": "taichi_water"}})");
  EXPECT_TRUE(unlike_training(weights, scene_with("dune", R"({"preset": "taichi_sand"})")).empty());
  const auto lines = unlike_training(weights, scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33})"));
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines[0].find("dune: friction_angle is 33"), std::string::npos) << lines[0];
  EXPECT_NE(lines[0].find("of the training 45"), std::string::npos) << lines[0];
}

TEST(TrainedMaterials, TellOfMaterialsThatWereNotThere) {
  const auto lines = unlike_training(taught(R"({"sand": {"preset": "taichi_sand"}})"),
                                     scene_with("snow", R"({"preset": "taichi_snow"})"));
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0], "snow: the training had no such material");
}

TEST(TrainedMaterials, SayNothingWhereWeightsDoNot) {
  EXPECT_TRUE(unlike_training({}, scene_with("snow", R"({"preset": "taichi_snow"})")).empty());
  for (const char* damaged : {"{", "{}", "[]", "3", R"({"water": {"density": -1}})"})
    EXPECT_THROW(unlike_training(taught(damaged), scene_with("snow", R"({"preset": "taichi_snow"})")), InputError)
        << damaged;
}

/// Weights of a training on sand of 20 to 45 degrees on floors of friction 0.1 to 0.7.
nn::Weights taught_ranges(bool with_inputs) {
  nn::Weights weights = taught(R"({"sand": {"preset": "taichi_sand"}})");
  nn::TrainedBox box;
  for (const char* angle : {"20", "45"}) {
    Scene scene = scene_with("dune", std::string(R"({"preset": "taichi_sand", "friction_angle": )") + angle + "}");
    scene.domain.wall_friction = *angle == '2' ? 0.1 : 0.7;
    box.widen(scene);
  }
  box.store(weights.metadata);
  weights.metadata["hgn.material_constants"] = weights.metadata["hgn.contact"] = with_inputs ? "true" : "false";
  return weights;
}

TEST(TrainedRanges, TellOfWhatIsOutside) {
  Scene scene = scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33})");
  scene.domain.wall_friction = 0.3;
  EXPECT_THAT(training_remarks(taught_ranges(true), scene), IsEmpty());
  scene.materials.at("dune").friction_angle = 50;
  scene.domain.walls = Contact::stick;
  EXPECT_THAT(training_remarks(taught_ranges(true), scene),
              ElementsAre("outside the training: sand.friction_angle is 50, of the training 20 to 45",
                          "outside the training: contact is stick, of the training separate"));
}

/// Constants that are no features (graph/features/material_constants.h) are not seen by any network.
TEST(TrainedRanges, TellOfConstantsThatAreNoInput) {
  nn::Weights weights = taught_ranges(true);
  nn::TrainedBox box = nn::TrainedBox::load(weights);
  box.ranges.at("sand.density") = {1400, 1800};
  box.store(weights.metadata);
  const Scene scene = scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33, "density": 1500})");
  EXPECT_THAT(unlike_training(weights, scene), ElementsAre("the network has no input for sand.density: it is 1500, and "
                                                           "the training had 1400 to 1800"));
}

/// A network that was taught various constants, but does not see them, knows their mean at best.
TEST(TrainedRanges, TellOfWhatTheNetworkDoesNotSee) {
  Scene scene = scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33})");
  scene.domain.wall_friction = 0.3;
  scene.sinks.emplace_back();
  EXPECT_THAT(training_remarks(taught_ranges(false), scene),
              ElementsAre("the network has no input for sand.friction_angle: it is 33, and the training had 20 to 45",
                          "the network has no input for contact.friction: it is 0.3, and the training had 0.1 to 0.7",
                          "the training had no scene with particles that come or go"));
}

TEST(TrainedRanges, TellOfChangesThatTheTrainingDidNotHave) {
  nn::Weights weights = taught_ranges(true);
  Scene scene = scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33})");
  scene.sinks.emplace_back();
  nn::TrainedBox box = nn::TrainedBox::load(weights);
  box.widen(scene);
  box.store(weights.metadata);
  EXPECT_THAT(training_remarks(weights, scene), testing::IsEmpty());
  scene.obstacles.emplace_back().motion = Motion{};
  EXPECT_THAT(training_remarks(weights, scene), testing::Contains("the training had no scene with moving obstacles"));
}

TEST(TrainedRanges, TellOfForcesThatNoNetworkSees) {
  Scene scene = scene_with("dune", R"({"preset": "taichi_sand", "friction_angle": 33})");
  scene.domain.wall_friction = 0.3;
  scene.loads.resize(2);
  EXPECT_THAT(training_remarks(taught_ranges(true), scene),
              ElementsAre("the network has no input for loads: it leaves out the scene's 2"));
  scene.loads.clear();
  scene.gravity_keyframes = {{1, {0, 0, 0}}};
  EXPECT_THAT(training_remarks(taught_ranges(true), scene),
              ElementsAre(testing::HasSubstr("no input for gravity that changes")));
}

}  // namespace
}  // namespace graupel::experiments
