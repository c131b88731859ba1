// Recipes of categories: what is read, and what is wrong with a bad one in words.
#include "io/scene/category_reader.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/scene/sweep_reader.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::string general = GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json";

CategoryRecipe read(const std::vector<std::string>& set) { return read_category_recipe(general, set); }

TEST(CategoryReader, TheGeneralRecipeReadsAndRoundTrips) {
  const CategoryRecipe recipe = read({"counts.train=7", "bodies.speed=[1,2]"});
  EXPECT_EQ(recipe.categories.size(), 8u);
  EXPECT_EQ(recipe.counts.train, 7);
  EXPECT_EQ(recipe.counts.test, 40);
  EXPECT_EQ(recipe.bodies.speed, (Interval{1, 2}));
  EXPECT_EQ(recipe.bodies.count, (WholeInterval{1, 8}));
  EXPECT_EQ(recipe.materials.at("sand").model, MaterialModel::sand);
  EXPECT_EQ(recipe.materials.at("sand").ranges.at("friction_angle"), (Interval{20, 45}));
  ASSERT_EQ(recipe.bodies.geometry.size(), 3u);
  EXPECT_FALSE(recipe.bodies.geometry[0].mesh->triangles.empty());
  EXPECT_FALSE(recipe.obstacles.level_set_geometry.at(0).mesh);

  const TemporaryFolder folder;
  const std::string text = category_recipe_to_json(recipe);
  for (const char* name : {"star.obj", "bracket.obj", "ring.obj", "trough.vdb"})
    folder.write(std::string("assets/") + name,
                 bytes_of(GRAUPEL_SOURCE_DIR "/scenes/recipes/assets/" + std::string(name)));
  EXPECT_EQ(category_recipe_to_json(read_category_recipe(folder.write("again.json", text))), text);
}

TEST(CategoryReader, ItsKeyTellsItFromOtherRecipes) {
  EXPECT_TRUE(is_category_recipe(general));
  EXPECT_FALSE(is_sweep(general));
  EXPECT_FALSE(is_category_recipe(GRAUPEL_SOURCE_DIR "/scenes/recipes/hgn.json"));
  EXPECT_FALSE(is_category_recipe(GRAUPEL_SOURCE_DIR "/scenes/recipes/nsf_jelly.json"));
}

TEST(CategoryReader, NamesTheUnknownCategoryAndTheMaterialThatOneLacks) {
  expect_error<ConfigError>(
      [] { read({"categories=[\"dam_brake\"]"}); },
      {"/categories/0", "dam_brake", "allowed: dam_break, column_collapse", "Did you mean 'dam_break'"});
  expect_error<ConfigError>([] { read({"categories=[]"}); }, {"/categories", "([], at least 1 entry)"});
  expect_error<ConfigError>([] { read({"materials={}"}); }, {"/materials", "is empty ({}, at least 1 entry)"});
  expect_error<ConfigError>(
      [] {
        read({"materials={\"water\": {\"preset\": \"water\"}}", "categories=[\"stream\", \"snow_impact\"]"});
      },
      {"/categories/1", "model snow", "Add one, or take the category out"});
}

TEST(CategoryReader, RefusesRangesThatAreNone) {
  expect_error<ConfigError>([] { read({"bodies.speed=[4,1]"}); },
                            {"/bodies/speed", "[4,1]", "low <= high", "Swap them"});
  expect_error<ConfigError>([] { read({"bodies.speed=[]"}); }, {"/bodies/speed", "interval of 2 numbers", "[]"});
  expect_error<ConfigError>([] { read({"bodies.speed=[-1,1]"}); }, {"/bodies/speed/0", "-1", "allowed >= 0"});
  expect_error<ConfigError>([] { read({"bodies.count=[1.5,2]"}); }, {"/bodies/count/0", "whole number"});
}

TEST(CategoryReader, RefusesConstantsThatAMaterialLacksOrMayNotHave) {
  expect_error<ConfigError>([] { read({"materials.sand.ranges.friction_angel=[20,30]"}); },
                            {"/materials/sand/ranges/friction_angel", "no constant of sand", "allowed: density",
                             "Did you mean 'friction_angle'"});
  expect_error<ConfigError>([] { read({"materials.water.ranges={\"hardening\": [5,10]}"}); },
                            {"/materials/water/ranges/hardening", "no constant of water", "viscosity"});
  expect_error<ConfigError>([] { read({"materials.sand.ranges.friction_angle=[20,95]"}); },
                            {"/materials/sand/ranges/friction_angle", "[20,95]", "allowed >= 0 and < 90"});
  expect_error<ConfigError>([] { read({"materials.sand.ranges.friction_angle=[45,20]"}); },
                            {"/materials/sand/ranges/friction_angle", "low <= high"});
}

TEST(CategoryReader, RefusesShapesThatCannotBeDrawnAndFilesThatAreNotThere) {
  expect_error<ConfigError>([] { read({"bodies.shapes=[\"box\", \"cone\"]"}); },
                            {"/bodies/shapes/1", "cone", "allowed: box, sphere, cylinder, mesh"});
  expect_error<ConfigError>([] { read({"obstacles.shapes=[\"plane\"]"}); }, {"/obstacles/shapes/0", "plane"});
  expect_error<ConfigError>([] { read({"obstacles.level_sets=[]"}); },
                            {"/obstacles/shapes/8", "vdb", "'level_sets' is empty", "take the shape out"});
  expect_error<InputError>([] { read({"bodies.meshes=[\"assets/stra.obj\"]"}); },
                           {"/bodies/meshes/0", "assets/stra.obj", "does not exist"});
  expect_error<InputError>([] { read({"bodies.meshes=[\"general.json\"]"}); }, {"/bodies/meshes/0"});
  expect_error<ConfigError>([] { read({"obstacles.level_sets=[\"assets/trough.vdb\", \"assets/star.obj\"]"}); },
                            {"/obstacles/level_sets/1", "assets/star.obj", "end in .vdb", "'meshes'"});
  expect_error<InputError>([] { read({"obstacles.level_sets=[\"assets/through.vdb\"]"}); },
                           {"/obstacles/level_sets/0", "assets/through.vdb", "does not exist"});
}

TEST(CategoryReader, RefusesWhatCannotHoldAScene) {
  expect_error<ConfigError>([] { read({"domain.sizes=[[1,1,1],[1,0.2,1]]"}); },
                            {"/domain/sizes/1", "too small", "cells along y"});
  expect_error<ConfigError>([] { read({"domain.sizes=[]"}); }, {"/domain/sizes", "at least 1 entry"});
  expect_error<ConfigError>([] { read({"domain.floor.kinds=[]"}); }, {"/domain/floor/kinds"});
  expect_error<ConfigError>([] { read({"max_particles=100"}); }, {"/max_particles", "(100, at least 135)"});
  expect_error<ConfigError>([] { read({"fields=affin"}); }, {"/fields", "affin"});
}

}  // namespace
}  // namespace graupel::io
