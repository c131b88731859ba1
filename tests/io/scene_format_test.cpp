#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "core/scene/material_config.h"
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

TEST(SceneFormat, SchemaOffersWhatTheReaderTakes) {
  using Words = std::set<std::string>;
  const auto schema = nlohmann::json::parse(scene_schema_json());
  const auto shapes = [&](const char* list) {
    return schema["properties"][list]["items"]["properties"]["shape"]["enum"].get<Words>();
  };
  const Words everywhere = {"box", "half_box", "sphere", "half_sphere", "cone", "pyramid", "cylinder", "mesh"};
  const auto and_also = [&](Words more) {
    more.insert(everywhere.begin(), everywhere.end());
    return more;
  };
  EXPECT_EQ(shapes("sources"), and_also({"points"}));
  EXPECT_EQ(shapes("emitters"), everywhere);
  EXPECT_EQ(shapes("obstacles"), and_also({"plane", "vdb"}));
  const auto& names = material_preset_names();
  Words presets(names.begin(), names.end());
  presets.insert("");
  EXPECT_EQ(schema["properties"]["materials"]["additionalProperties"]["properties"]["preset"]["enum"].get<Words>(),
            presets);
  EXPECT_EQ(schema["properties"]["gravity"]["items"]["maximum"], 1e6);
  EXPECT_EQ(schema["properties"]["frame_time"]["maximum"], 1e6);
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
