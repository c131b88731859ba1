// Networks know materials by their type; a scene with others than those of the training is told of.
#include "experiments/models/trained_materials.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {
namespace {

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
  EXPECT_THROW(unlike_training(taught("{"), scene_with("snow", R"({"preset": "taichi_snow"})")), InputError);
}

}  // namespace
}  // namespace graupel::experiments
