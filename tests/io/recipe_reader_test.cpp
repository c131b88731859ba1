#include "io/scene/recipe_reader.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::string water = "\"materials\": { \"water\": { \"preset\": \"water\" } }";

TEST(RecipeReader, PaperRecipeReadsAndRoundTrips) {
  const SceneRecipe recipe =
      read_recipe(GRAUPEL_SOURCE_DIR "/scenes/recipes/hgn.json", {"counts.train=7", "groups.max_speed=2"});
  EXPECT_EQ(recipe.groups.count, 4);
  EXPECT_EQ(recipe.obstacles.count, 5);
  EXPECT_EQ(recipe.obstacles.shapes.size(), 5u);
  EXPECT_EQ(recipe.counts.train, 7);
  EXPECT_EQ(recipe.groups.max_speed, 2);
  EXPECT_EQ(recipe.time_step.substeps_per_frame, 54);
  EXPECT_EQ(recipe.materials.at("snow").max_hardening, 0);

  const TemporaryFolder folder;
  const std::string text = recipe_to_json(recipe);
  EXPECT_EQ(recipe_to_json(read_recipe(folder.write("again.json", text))), text);
}

TEST(RecipeReader, NamesTheMaterialThatIsNotDefined) {
  const TemporaryFolder folder;
  const auto file = folder.write("r.json", "{" + water + ",\n\"groups\": { \"materials\": [\"watr\"] } }");
  expect_error<ConfigError>([&] { read_recipe(file); },
                            {"r.json:2", "/groups/materials/0", "watr", "Did you mean 'water'"});
}

TEST(RecipeReader, RefusesNoMaterialAndSizesOutOfOrder) {
  const TemporaryFolder folder;
  const auto none = folder.write("none.json", "{\"materials\": {}}");
  expect_error<ConfigError>([&] { read_recipe(none); }, {"none.json", "/materials"});
  const auto sizes =
      folder.write("sizes.json", "{" + water + ", \"obstacles\": { \"min_size\": 0.4, \"max_size\": 0.2 } }");
  expect_error<ConfigError>([&] { read_recipe(sizes); }, {"/obstacles/max_size", "min_size (0.4)"});
  const auto wide = folder.write("wide.json", "{" + water + ", \"groups\": { \"size\": 5 } }");
  expect_error<ConfigError>([&] { read_recipe(wide); },
                            {"/groups/size", "too large for the room inside the walls (5 m"});
  const auto plane = folder.write("plane.json", "{" + water + ", \"domain\": { \"dimensions\": 2 } }");
  expect_error<ConfigError>([&] { read_recipe(plane); }, {"/domain/dimensions", "must be 3"});
  expect_error<InputError>([&] { read_recipe(folder.file("absent.json")); }, {"absent.json"});
}

}  // namespace
}  // namespace graupel::io
