#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/scene/scene_reader.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::string remedy = "write it anew: GRAUPEL_WRITE_FORMAT=1 tests run with --gtest_filter=SceneFormat.*";

/// The file in the source tree must be what the declarations give.
void check_generated(const std::string& name, const std::string& text) {
  const std::string path = std::string(GRAUPEL_SOURCE_DIR) + "/" + name;
  if (std::getenv("GRAUPEL_WRITE_FORMAT")) std::ofstream(path, std::ios::binary) << text;
  EXPECT_TRUE(bytes_of(path) == text) << name << " is out of date; " << remedy;
}

TEST(SceneFormat, DocumentationIsUpToDate) {
  check_generated("docs/reference/scene_format.md", scene_format_markdown());
}
TEST(SceneFormat, SchemaIsUpToDate) { check_generated("scenes/schema.json", scene_schema_json()); }

TEST(SceneFormat, SchemaRefusesUnknownKeysAndTiesKeysToShapes) {
  const auto schema = nlohmann::json::parse(scene_schema_json());
  EXPECT_EQ(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
  EXPECT_EQ(schema["additionalProperties"], false);
  const auto& source = schema["properties"]["sources"]["items"];
  EXPECT_EQ(source["additionalProperties"], false);
  EXPECT_EQ(source["properties"]["radius"]["exclusiveMinimum"], 0);
  bool found = false;
  for (const auto& rule : source["allOf"]) {
    if (rule["if"]["properties"]["shape"]["const"] != "sphere") continue;
    found = true;
    EXPECT_EQ(rule["then"]["required"], nlohmann::json({"radius"}));
    EXPECT_EQ(rule["then"]["properties"]["size"], false);
    EXPECT_FALSE(rule["then"]["properties"].contains("radius"));
  }
  EXPECT_TRUE(found);
  EXPECT_EQ(
      schema["properties"]["materials"]["additionalProperties"]["properties"]["poissons_ratio"]["exclusiveMaximum"],
      0.5);
}

TEST(SceneFormat, DefaultsNameEveryKeyWithUnit) {
  const std::string text = scene_defaults();
  for (const char* part :
       {"\"dx\": 0.015625,  // Grid spacing [m]; > 0", "// \"obstacle_voxel\": null", "\"courant\": 0.5",
        "// \"substeps_per_frame\": 54", "\"friction_angle\"", "only for shape: sphere"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
}

}  // namespace
}  // namespace graupel::io
