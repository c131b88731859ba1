// metadata.json of other programs: what is read, what is refused, what is written.
#include "io/simulator_metadata.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "io/particle_type_table.h"
#include "tests/io/expect_error.h"
#include "tests/io/temporary_folder.h"

namespace graupel::io {
namespace {

using Json = nlohmann::ordered_json;

/// The example of geoelements/gns's documentation.
Json gns_example() {
  return Json::parse(R"({"bounds": [[0.1, 0.9], [0.1, 0.9]], "sequence_length": 320,
    "default_connectivity_radius": 0.015, "dim": 2, "dt": 0.0025,
    "vel_mean": [5.1e-06, -0.00099], "vel_std": [0.0021, 0.0026],
    "acc_mean": [5.2e-07, 2.3e-07], "acc_std": [0.00025, 0.00029]})");
}

SimulatorMetadata read(const Json& json) {
  const TemporaryFolder folder;
  return read_simulator_metadata(folder.write("metadata.json", json.dump()));
}

void expect_refused(const std::string& key, const Json& value, const std::string& words) {
  Json json = gns_example();
  json[key] = value;
  expect_error<InputError>([&] { read(json); }, {"metadata.json", key + "' ", words});
}

TEST(SimulatorMetadata, OfGnsIsRead) {
  const SimulatorMetadata m = read(gns_example());
  EXPECT_EQ(m.dimensions, 2);
  EXPECT_EQ(m.bounds, (std::vector<std::array<double, 2>>{{0.1, 0.9}, {0.1, 0.9}}));
  EXPECT_EQ(m.frame_time, 0.0025);
  EXPECT_EQ(m.connectivity_radius, 0.015);
  EXPECT_EQ(m.motion.acceleration_std, (std::vector<double>{0.00025, 0.00029}));
  EXPECT_EQ(m.periodic, (std::vector<bool>{false, false}));
  EXPECT_FALSE(m.gravity || m.grid_spacing || m.particle_spacing);
}

TEST(SimulatorMetadata, OfLagrangeBenchIsRead) {
  Json json = gns_example();
  json.update({{"case", "RPF"},
               {"write_every", 100},
               {"dx", 0.02},
               {"sequence_length", nullptr},
               {"periodic_boundary_conditions", {true, false, true}}});  // three also in the plane
  const SimulatorMetadata m = read(json);
  EXPECT_EQ(m.name, "RPF");
  EXPECT_DOUBLE_EQ(m.frame_time, 0.25);
  EXPECT_EQ(m.particle_spacing, 0.02);
  EXPECT_EQ(m.periodic, (std::vector<bool>{true, false}));
}

TEST(SimulatorMetadata, OfTwoPartsGivesThatOfTheTraining) {
  Json rollout = gns_example();
  rollout["bounds"] = {{0.1, 1.9}, {0.1, 0.9}};
  EXPECT_EQ(read({{"train", gns_example()}, {"rollout", rollout}}).bounds[0][1], 0.9);
}

TEST(SimulatorMetadata, MissingKeysAreNamed) {
  for (const char* key :
       {"bounds", "default_connectivity_radius", "dim", "dt", "vel_mean", "vel_std", "acc_mean", "acc_std"}) {
    Json json = gns_example();
    json.erase(key);
    expect_error<InputError>([&] { read(json); }, {std::string(key) + "' is missing"});
  }
}

TEST(SimulatorMetadata, BadValuesAreNamed) {
  expect_refused("dim", 4, "is 4 (needed: a whole number from 2 to 3)");
  expect_refused("dim", 2.5, "is 2.5");
  expect_refused("dim", "2", "is \"2\"");
  expect_refused("dt", 0, "is 0 (needed: a number above 0)");
  expect_refused("dt", nullptr, "is null");
  expect_refused("write_every", 0, "is 0 (needed: a whole number from 1");
  expect_refused("default_connectivity_radius", -1, "is -1 (needed: a number above 0)");
  expect_refused("dx", 0, "a number above 0");
  expect_refused("sequence_length", -3, "is -3");
  expect_refused("sequence_length_train", "many", "is \"many\"");
  expect_refused("gravity", {0, -9.8}, "needed: 3 numbers");
  expect_refused("grid_spacing", "small", "a number above 0");
}

TEST(SimulatorMetadata, KeysThatDoNotFitTheDimensionsAreNamed) {
  Json json = gns_example();
  json["dim"] = 3;
  expect_error<InputError>([&] { read(json); }, {"'bounds' is", "needed: 3 pairs"});
  expect_refused("bounds", {{0, 1}}, "needed: 2 pairs");
  expect_refused("bounds", {{0, 1}, {1, 0}}, "low below high");
  expect_refused("bounds", {{0, 1}, {0, 1, 2}}, "needed: 2 pairs");
  expect_refused("bounds", 1, "needed: 2 pairs");
  expect_refused("vel_mean", {0, 0, 0}, "needed: 2 numbers, as dim says");
  expect_refused("vel_std", {1, -1}, "2 numbers, 0 or more");
  expect_refused("acc_mean", {0, "x"}, "needed: 2 numbers");
  expect_refused("acc_std", {1}, "2 numbers, 0 or more");
  expect_refused("periodic_boundary_conditions", {true}, "2 times true or false");
  expect_refused("periodic_boundary_conditions", {1, 0}, "2 times true or false");
}

TEST(SimulatorMetadata, FilesThatAreNoJsonAreNamed) {
  const TemporaryFolder folder;
  expect_error<InputError>([&] { read_simulator_metadata(folder.write("metadata.json", "{\"dim\": 2,}")); },
                           {"metadata.json"});
  expect_error<InputError>([&] { read_simulator_metadata(folder.file("missing.json")); }, {"missing.json"});
}

SimulatorMetadata sample() {
  SimulatorMetadata m = read(gns_example());
  m.name = "sample";
  m.gravity = {0, -9.8, 0};
  m.grid_spacing = 0.01;
  return m;
}

TEST(SimulatorMetadata, OfGnsComesBack) {
  const TemporaryFolder folder;
  const std::map<std::string, SplitFigures> splits = {
      {"train", {.trajectories = 2, .most_particles = 9, .fewest_frames = 30, .most_frames = 30}},
      {"test", {.trajectories = 1, .most_particles = 12, .fewest_frames = 30, .most_frames = 30}}};
  const std::string text = gns_metadata_text(sample(), splits, {{5, "water"}});
  const Json json = Json::parse(text);
  EXPECT_EQ(json["sequence_length"], 30);  // frames, as its rollouts count
  EXPECT_EQ(json["nnode_in"], 30);         // its default in two dimensions
  EXPECT_EQ(json["nedge_in"], 3);
  EXPECT_EQ(json["material_names"]["5"], "water");
  const SimulatorMetadata back = read_simulator_metadata(folder.write("metadata.json", text));
  EXPECT_EQ(back.bounds, sample().bounds);
  EXPECT_EQ(back.motion.velocity_std, sample().motion.velocity_std);
  EXPECT_EQ(back.gravity, sample().gravity);
  EXPECT_EQ(back.grid_spacing, sample().grid_spacing);
  EXPECT_EQ(back.frame_time, sample().frame_time);
}

TEST(SimulatorMetadata, OfGnsSaysWhatDiffers) {
  const std::map<std::string, SplitFigures> splits = {
      {"train",
       {.trajectories = 2, .most_particles = 9, .fewest_frames = 20, .most_frames = 30, .material_property = true}}};
  const Json json = Json::parse(gns_metadata_text(sample(), splits, {}));
  EXPECT_TRUE(json["sequence_length"].is_null());
  EXPECT_EQ(json["nnode_in"], 31);
  EXPECT_EQ(json["material_feature_len"], 1);
}

TEST(SimulatorMetadata, OfLagrangeBenchComesBack) {
  const std::map<std::string, SplitFigures> splits = {
      {"train", {.trajectories = 2, .most_particles = 9, .fewest_frames = 31, .most_frames = 31}},
      {"test", {.trajectories = 1, .most_particles = 12, .fewest_frames = 11, .most_frames = 11}}};
  const Json json = Json::parse(lagrangebench_metadata_text(sample(), splits, {{0, "water"}}));
  EXPECT_EQ(json["sequence_length_train"], 30);
  EXPECT_EQ(json["sequence_length_test"], 10);
  EXPECT_EQ(json["num_trajs_train"], 2);
  EXPECT_EQ(json["num_particles_max"], 12);
  EXPECT_EQ(json["write_every"], 1);
  EXPECT_EQ(json["periodic_boundary_conditions"], Json({false, false}));
  EXPECT_DOUBLE_EQ(json["dx"], 0.015 / 1.45);
  EXPECT_EQ(read(json).connectivity_radius, 0.015);
}

TEST(ParticleTypeTable, MapsBothWays) {
  const ParticleTypeTable gns(DataSetFormat::gns, ""), bench(DataSetFormat::lagrangebench, "");
  const std::vector<int64_t> of_gns = {3, 4, 5, 6, 7, 8}, of_bench = {0, 1, 2, 4, 6, 7, 8};
  EXPECT_EQ(gns.to_ours(of_gns, "x"), (std::vector<int32_t>{3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(bench.to_ours(of_bench, "x"), (std::vector<int32_t>{5, 3, 13, 4, 6, 7, 8}));
  EXPECT_EQ(gns.to_theirs(gns.to_ours(of_gns, "x"), "x"), of_gns);
  EXPECT_EQ(bench.to_theirs(bench.to_ours(of_bench, "x"), "x"), of_bench);
}

TEST(ParticleTypeTable, ChangesWinBothWays) {
  const ParticleTypeTable table(DataSetFormat::gns, "0=metal,5=sand,1=obstacle");
  EXPECT_EQ(table.to_ours({0, 5, 1, 3}, "x"), (std::vector<int32_t>{10, 6, 3, 3}));
  EXPECT_EQ(table.to_theirs({10, 6, 3}, "x"), (std::vector<int64_t>{0, 5, 1}));
}

TEST(ParticleTypeTable, NamesEveryUnknownType) {
  const ParticleTypeTable table(DataSetFormat::gns, "");
  expect_error<InputError>(
      [&] {
        table.to_ours({5, 0, 1, 0}, "'a.npz': 'x'");
      },
      {"'a.npz': 'x' has particles", "types 0, 1 of gns", "--types 0=jelly,1=jelly"});
  expect_error<InputError>(
      [&] {
        table.to_theirs({5, 10, 12}, "'a.h5'");
      },
      {"'a.h5' has particles", "(metal, foam)", "--types N=metal,N=foam"});
  expect_error<InputError>([&] { ParticleTypeTable(DataSetFormat::gns, "9=metal").to_theirs({10}, "'a.h5'"); },
                           {"numbers from 0 to 8"});
}

TEST(ParticleTypeTable, BadChangesAreNamed) {
  for (const char* text : {"water", "=water", "x=water", "5.5=water", "-1=water"})
    expect_error<ConfigError>([&] { ParticleTypeTable(DataSetFormat::gns, text); },
                              {"--types '" + std::string(text) + "' is not NUMBER=MATERIAL"});
  expect_error<ConfigError>([&] { ParticleTypeTable(DataSetFormat::gns, "5=watr"); },
                            {"names no material ('watr'", "Did you mean 'water'?"});
}

}  // namespace
}  // namespace graupel::io
