#include "io/scene/scene_reader.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "replaced.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::string good = R"({
  "name": "test",
  "domain": {"size": [1, 2, 1], "dx": 0.02},  // metres
  "materials": {
    "wet": {"preset": "taichi_water", "density": 900},
    "soft": {"model": "jelly", "youngs_modulus": 5e4}
  },
  "sources": [
    {"shape": "box", "size": [0.2, 0.2, 0.2], "material": "wet", "position": [0.5, 1, 0.5]}
  ],
  "obstacles": [
    {"shape": "cylinder", "radius": 0.1, "height": 0.3, "contact": "slip", "friction": 0.5, "rotation_angle": 45}
  ]
}
)";

Scene parse(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return parse_scene(text, "s.json", "/", overrides);
}

void fails(const std::string& from, const std::string& to, const std::vector<std::string>& parts) {
  expect_error<ConfigError>([&] { parse(replaced(good, from, to)); }, parts);
}

TEST(SceneReader, ReadsAScene) {
  const Scene scene = parse(good);
  EXPECT_EQ(scene.domain.size, (Vec3d{1, 2, 1}));
  EXPECT_EQ(scene.domain.walls, Contact::separate);
  EXPECT_EQ(scene.gravity, (Vec3d{0, -9.8, 0}));
  const MaterialConfig& wet = scene.materials.at("wet");
  EXPECT_EQ(wet.name, "wet");
  EXPECT_EQ(wet.density, 900);
  EXPECT_EQ(wet.bulk_modulus, material_preset("taichi_water")->bulk_modulus);
  EXPECT_EQ(scene.materials.at("soft").model, MaterialModel::jelly);
  EXPECT_EQ(scene.materials.at("soft").youngs_modulus, 5e4);
  ASSERT_EQ(scene.obstacles.size(), 1u);
  EXPECT_EQ(scene.obstacles[0].shape, Shape::cylinder);
  EXPECT_EQ(scene.obstacles[0].contact, Contact::slip);
  EXPECT_EQ(scene.obstacles[0].rotation_angle, 45);
  EXPECT_DOUBLE_EQ(scene.band(), 0.1);
}

TEST(SceneReader, PresetDecidesWhichKeysApply) {
  const Scene scene = parse(replaced(good, "\"model\": \"jelly\"", "\"preset\": \"taichi_snow\", \"hardening\": 7"));
  EXPECT_EQ(scene.materials.at("soft").model, MaterialModel::snow);
  EXPECT_EQ(scene.materials.at("soft").hardening, 7);
  EXPECT_EQ(scene.materials.at("soft").max_hardening, 0);
}

TEST(SceneReader, RoundTrips) {
  const Scene scene = parse(good);
  const std::string text = scene_to_json(scene);
  EXPECT_EQ(scene_to_json(parse(text)), text);
  const std::string defaults = scene_defaults();
  EXPECT_EQ(scene_to_json(parse(scene_to_json(parse(defaults)))), scene_to_json(parse(defaults)));
}

TEST(SceneReader, SourceTextIsTheSceneWithOverrides) {
  const Scene scene = parse(replaced(good, "{", "{\"$schema\": \"schema.json\", "), {"domain.dx=0.025", "frames=7"});
  EXPECT_EQ(scene.domain.dx, 0.025);
  EXPECT_EQ(scene.frames, 7);
  EXPECT_EQ(scene.source.find("$schema"), std::string::npos);
  EXPECT_EQ(scene_to_json(parse(scene.source)), scene_to_json(scene));
}

TEST(SceneReader, RefusesKeysThatDoNotApply) {
  fails("\"dx\"", "\"dxx\"", {"s.json:3: /domain/dxx is not a known key", "Did you mean 'dx'?"});
  fails("\"radius\": 0.1, ", "\"size\": [1, 1, 1], ",
        {"s.json:12: /obstacles/0/size does not apply here (shape is 'cylinder'; the key is for: box, half_box, "
         "pyramid)"});
  fails("\"radius\": 0.1, ", "", {"s.json:12: /obstacles/0 lacks the key 'radius'"});
  fails("\"model\": \"jelly\", ", "",
        {"s.json:6: /materials/soft/youngs_modulus does not apply here (model is 'water'"});
  fails("\"materials\"", "\"$schema\": \"x\", \"material\"",
        {"s.json:4: /material is not a known key", "Did you mean 'materials'?"});
  fails("\"shape\": \"box\", ", "", {"s.json:9: /sources/0 lacks the key 'shape'"});
  fails("\"contact\": \"slip\"", "\"contact\": \"slop\"",
        {"s.json:12: /obstacles/0/contact is not one of its words (\"slop\", allowed: stick, slip, separate)",
         "'slip'?"});
  fails("\"shape\": \"cylinder\"", "\"shape\": \"point\"",
        {"/obstacles/0/shape is not one of its words (\"point\", allowed: box, half_box, sphere, half_sphere, cone, "
         "pyramid, cylinder, plane, mesh, vdb)"});
  const std::pair<const char*, const char*> out_of_range[] = {
      {"frame_time=2e6", "/frame_time is out of range (2e+06, allowed > 0 and <= 1e+06)"},
      {"gravity=[0,-2e6,0]", "/gravity/1 is out of range (-2e+06, allowed"}};
  for (const auto& [override, message] : out_of_range)
    expect_error<ConfigError>([&] { parse(good, {override}); }, {message});
}

/// Every range of a material's constants, by one value outside it.
TEST(SceneReader, RefusesMaterialConstantsOutOfRange) {
  const std::tuple<std::string, std::string, std::string> bad[] = {{"water", "density", "0"},
                                                                   {"water", "bulk_modulus", "-1"},
                                                                   {"water", "viscosity", "-0.1"},
                                                                   {"metal", "youngs_modulus", "-1e+06"},
                                                                   {"metal", "poissons_ratio", "0.5"},
                                                                   {"neo_hookean", "poissons_ratio", "-0.1"},
                                                                   {"sand", "friction_angle", "90"},
                                                                   {"sand", "cohesion", "-1"},
                                                                   {"snow", "critical_compression", "1"},
                                                                   {"snow", "critical_stretch", "-0.1"},
                                                                   {"snow", "hardening", "-1"},
                                                                   {"snow", "max_hardening", "-1"},
                                                                   {"metal", "yield_stress", "-1"},
                                                                   {"metal", "hardening_modulus", "-1"},
                                                                   {"cake", "softening_modulus", "-1"},
                                                                   {"toothpaste", "consistency", "-1"},
                                                                   {"foam", "flow_index", "0"}};
  const auto material = [](const std::string& text) {
    return replaced(good, "{\"model\": \"jelly\", \"youngs_modulus\": 5e4}", text);
  };
  for (const auto& [model, key, value] : bad)
    expect_error<ConfigError>(
        [&] { parse(material("{\"model\": \"" + model + "\", \"" + key + "\": " + value + "}")); },
        {"s.json:6: /materials/soft/" + key + " is out of range (" + value + ", allowed "});
  expect_error<ConfigError>(
      [&] { parse(material("{\"model\": \"water\", \"equation_of_state\": \"tait\", \"tait_exponent\": 0.5}")); },
      {"/materials/soft/tait_exponent is out of range (0.5, allowed >= 1 and <= 20)"});
  expect_error<ConfigError>([&] { parse(material("{\"model\": \"water\", \"tait_exponent\": 7}")); },
                            {"tait_exponent does not apply here (equation_of_state is 'linear'"});
}

TEST(SceneReader, EveryPresetReadsBackToItself) {
  for (const std::string& name : material_preset_names()) {
    const Scene scene = parse(replaced(good, "taichi_water\", \"density\": 900", name + "\""));
    EXPECT_EQ(scene.materials.at("wet").preset, name);
    EXPECT_EQ(scene_to_json(parse(scene_to_json(scene))), scene_to_json(scene));
  }
}

TEST(SceneReader, RefusesUnknownPresets) {
  fails("taichi_water", "taichi_watr",
        {"s.json:5: /materials/wet/preset is not one of its words (\"taichi_watr\"", "Did you mean 'taichi_water'?"});
}

TEST(SceneReader, RefusesPartsThatDoNotFit) {
  fails("\"material\": \"wet\"", "\"material\": \"wett\"",
        {"s.json:9: /sources/0/material names no material of the scene (\"wett\", there are: soft, wet)", "'wet'?"});
  fails("\"rotation_angle\": 45", "\"rotation_axis\": [0, 0, 0]",
        {"s.json:12: /obstacles/0/rotation_axis must not be zero"});
  fails("\"dx\": 0.02", "\"dx\": 0.05",
        {"s.json:3: /domain/size is too small for its grid (20 cells along x, at least 22"});
  fails("\"dx\": 0.02", "\"dx\": 2e-7", {"s.json:3: /domain/size has too many cells", "at most 2097152"});
  fails("\"shape\": \"box\", \"size\": [0.2, 0.2, 0.2]", "\"shape\": \"plane\"",
        {"s.json:9: /sources/0/shape cannot be filled with material (\"plane\""});
  fails("\"shape\": \"box\", \"size\": [0.2, 0.2, 0.2]", "\"shape\": \"vdb\", \"file\": \"a.vdb\"",
        {"s.json:9: /sources/0/shape cannot be filled with material (\"vdb\""});
  fails("\"shape\": \"cylinder\", \"radius\": 0.1, \"height\": 0.3", "\"shape\": \"points\", \"file\": \"a.xyz\"",
        {"s.json:12: /obstacles/0/shape has no surface"});
  expect_error<ConfigError>([] { parse(good, {"sources=[]"}); }, {"(override sources=[]): /sources must not be empty"});
}

TEST(SceneReader, LoadsGeometryRelativeToTheScene) {
  TemporaryFolder folder;
  folder.write("shared/tet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  folder.write("shared/p.xyz", "1 2 3\n4 5 6\n");
  const std::string path = folder.write("scenes/a.json", R"({"materials": {"w": {}}, "sources": [
    {"shape": "points", "file": "../shared/p.xyz", "scale": 0.1, "material": "w"}],
    "obstacles": [{"shape": "mesh", "file": "../shared/tet.obj", "scale": 2}]})");
  const Scene scene = read_scene(path);
  ASSERT_TRUE(scene.sources[0].points);
  EXPECT_DOUBLE_EQ((*scene.sources[0].points)[1][2], 0.6);
  ASSERT_TRUE(scene.obstacles[0].mesh);
  EXPECT_EQ(scene.obstacles[0].mesh->vertices[1], (Vec3d{2, 0, 0}));
  EXPECT_EQ(scene.obstacles[0].file, folder.file("shared/tet.obj"));
  EXPECT_EQ(scene.file, path);
  const Scene again = parse_scene(scene.source, "stored", "/");  // self-contained: the folder does not matter
  EXPECT_EQ(again.obstacles[0].mesh->triangles.size(), 4u);
}

TEST(SceneReader, NamesMissingAndDamagedGeometry) {
  TemporaryFolder folder;
  folder.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
  const std::string text =
      "{\"materials\": {\"w\": {}},\n\"sources\": [{\"shape\": \"mesh\", \"material\": \"w\",\n\"file\": \"FILE\"}]}";
  const std::string missing = folder.write("missing.json", replaced(text, "FILE", "no/../none.obj"));
  expect_error<InputError>([&] { read_scene(missing); },
                           {missing + ":3: /sources/0/file names a file that does not exist (\"no/../none.obj\"",
                            "looked for at '" + folder.file("none.obj") + "'", "relative to the scene file"});
  const std::string damaged = folder.write("damaged.json", replaced(text, "FILE", "bad.obj"));
  expect_error<InputError>([&] { read_scene(damaged); },
                           {damaged + ":3: /sources/0/file", "bad.obj", "does not exist"});
  expect_error<InputError>([&] { read_scene(folder.file("nothing.json")); }, {"nothing.json", "No such file"});
}

TEST(SceneReader, OverridesOfItemsKnowTheDefaultsOfTheScene) {
  const Scene scene = parse(good, {"gravity.1=-5", "sources.0.velocity.0=2", "domain.origin.2=1"});
  EXPECT_EQ(scene.gravity, (Vec3d{0, -5, 0}));
  EXPECT_EQ(scene.sources[0].velocity, (Vec3d{2, 0, 0}));
  EXPECT_EQ(scene.domain.origin, (Vec3d{0, 0, 1}));
  EXPECT_EQ(parse(scene.source).gravity, scene.gravity);  // as stored
  expect_error<ConfigError>([] { parse(good, {"sources.0.spin_center.1=2"}); },
                            {"/sources/0/spin_center is not given", "Set all of it: sources.0.spin_center=VALUE"});
  expect_error<ConfigError>([] { parse(good, {"obstacles.0.size.1=2"}); }, {"/obstacles/0/size does not apply here"});
  expect_error<ConfigError>([] { parse(replaced(good, "\"size\": [0.2, 0.2, 0.2], ", ""), {"sources.0.size.1=2"}); },
                            {"/sources/0/size is not given"});
}

TEST(SceneReader, VectorsTooShortOrLongForADirectionAreShownAsTheyAre) {
  for (const std::string axis : {"[1e-300, 0, 0]", "[0, -1e-150, 2e-150]", "[1e+200, 0, 0]"})
    fails("\"rotation_angle\": 45", "\"rotation_angle\": 45, \"rotation_axis\": " + axis,
          {"/obstacles/0/rotation_axis is too ", "(" + axis + ", allowed lengths: 1e-100 to 1e+100)"});
  EXPECT_NO_THROW(parse(replaced(good, "\"rotation_angle\": 45", "\"rotation_axis\": [1e-90, 0, 0]")));
}

TEST(SceneReader, ADamagedStoredSceneIsAFaultOfItsFile) {
  for (const std::string& text : {replaced(good, "0.02", "-0.02"), good.substr(1), std::string("{}")}) {
    expect_error<InputError>([&] { parse_stored_scene(text, "w.safetensors", "w.safetensors"); },
                             {"'w.safetensors': the scene stored in it is damaged", "Train again, or copy the file"});
    expect_error<InputError>([&] { parse_stored_scene(text, "a.h5", "a.h5", {"frames=2"}); },
                             {"'a.h5': the scene stored in it is damaged", "Make it again, or copy it anew"});
  }
  expect_error<ConfigError>([] { parse_stored_scene(good, "a.h5", "a.h5", {"frames=-2"}); }, {"override frames=-2"});
}

TEST(SceneReader, EveryTruncationIsAnError) {
  const std::string text = good.substr(0, good.rfind('}'));
  for (std::size_t n = 0; n < text.size(); ++n) EXPECT_THROW(parse(text.substr(0, n)), InputError) << n;
}

TEST(SceneReader, AStoredSceneFindsItsGeometryWhereTheTrajectoryWasMoved) {
  TemporaryFolder folder;
  const std::string tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  folder.write("old/scenes/meshes/tet.obj", tetrahedron);
  const std::string path = folder.write("old/scenes/s.json", R"({"materials": {"w": {}},
    "sources": [{"shape": "box", "size": [0.2, 0.2, 0.2], "material": "w", "position": [0.5, 0.5, 0.5]}],
    "obstacles": [{"shape": "mesh", "file": "meshes/tet.obj"}]})");
  const std::string stored = read_scene(path).source;
  const auto found = [&](const std::string& h5) {
    const Scene scene = parse_stored_scene(stored, h5, folder.file(h5));
    EXPECT_TRUE(scene.obstacles[0].mesh);
    EXPECT_NE(scene.source.find(scene.obstacles[0].file), std::string::npos);
    return scene.obstacles[0].file;
  };
  const std::string old = folder.file("old/scenes/meshes/tet.obj");
  EXPECT_EQ(found("elsewhere/a.h5"), old);
  // The whole folder is moved, then the file alone goes beside the trajectory.
  std::filesystem::rename(folder.file("old"), folder.file("new"));
  EXPECT_EQ(found("new/out/a.h5"), folder.file("new/scenes/meshes/tet.obj"));
  EXPECT_EQ(found("new/scenes/meshes/a.h5"), folder.file("new/scenes/meshes/tet.obj"));
  expect_error<InputError>([&] { found("new/a/b/c/d/e/a.h5"); },
                           {"/obstacles/0/file", "looked for at '" + old + "'", "stored in", "put 'tet.obj' beside"});
  folder.write("far/a/tet.obj", tetrahedron);
  EXPECT_EQ(found("far/a/a.h5"), folder.file("far/a/tet.obj"));
}

}  // namespace
}  // namespace graupel::io
