// Data sets from one format to another and back.
#include "io/data_set_conversion.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "io/gns_data_set.h"
#include "io/lagrangebench_data_set.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "tests/io/expect_error.h"
#include "tests/io/sample_series.h"
#include "tests/io/temporary_folder.h"

namespace graupel::io {
namespace {

using Json = nlohmann::ordered_json;

std::string scene_text(int dimensions, const std::string& more = "") {
  return R"({"name": "drop", "domain": {"dimensions": )" + std::to_string(dimensions) +
         R"(, "size": [2, 2, 1], "dx": 0.03125, "wall_cells": 4}, "gravity": [0, -5, 0], "frames": 5, "frame_time": 0.02,
    "materials": {"w": {"model": "water"}, "s": {"model": "sand"}},
    "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "w"}])" +
         more + "}";
}

/// A run of the material types 5 and 6, whose positions use every bit.
void write_run(const std::string& file, int dimensions, int number, const std::string& more = "") {
  Trajectory header;
  header.particle_type = {5, 6, 5, 6, 6};
  header.frame_time = 0.02;
  header.scene_json = scene_to_json(parse_scene(scene_text(dimensions, more), "test", ""));
  TrajectoryWriter writer(file, header, {.velocity = false});
  for (int t = 0; t < 6; ++t) {
    ParticleFrame frame;
    frame.time = 0.02 * t;
    for (int p = 0; p < 5; ++p) {
      const float s = static_cast<float>(number) + 0.37f * static_cast<float>(p) + 0.01f * static_cast<float>(t * t);
      frame.position.push_back({0.9f + 0.5f * std::sin(s), 1 + 0.3f * std::cos(3 * s), 0.5f});
      if (dimensions == 3) frame.position.back()[2] = 0.5f + 0.2f * std::sin(5 * s);
    }
    writer.append(frame);
  }
  writer.finish();
}

class Convert : public testing::Test {
 protected:
  /// 2 + 1 + 1 runs.
  std::string own_set(int dimensions, const std::string& more = "") {
    const std::string set = folder_.file("own" + std::to_string(dimensions));
    make_folder(set);
    write_run(folder_.file("a.h5"), dimensions, 0, more);
    write_run(folder_.file("b.h5"), dimensions, 1, more);
    merge_trajectories({folder_.file("a.h5"), folder_.file("b.h5")}, set + "/train.h5");
    write_run(set + "/valid.h5", dimensions, 2);
    write_run(set + "/test.h5", dimensions, 3);
    write_data_set_metadata(set, parse_scene(scene_text(dimensions), "test", ""), 0.07);
    return set;
  }
  ConversionResult convert(const std::string& from, const std::string& to, DataSetFormat format,
                           const std::function<void(ConversionOptions&)>& more = {}) {
    ConversionOptions options;
    options.input = from;
    options.output = to;
    options.format = format;
    options.made_by = "test";
    if (more) more(options);
    return convert_data_set(options);
  }
  Json metadata(const std::string& set) { return Json::parse(read_file(set + "/metadata.json")); }
  TemporaryFolder folder_;
};

void expect_same_runs(const std::string& a, const std::string& b) {
  const TrajectoryReader one(a), other(b);
  ASSERT_EQ(one.count(), other.count());
  for (int i = 0; i < one.count(); ++i) {
    const Trajectory x = one.read(i), y = other.read(i);
    EXPECT_EQ(x.particle_type, y.particle_type);
    EXPECT_EQ(x.frame_time, y.frame_time);
    ASSERT_EQ(x.frame_count(), y.frame_count());
    for (std::size_t t = 0; t < x.frame_count(); ++t) EXPECT_EQ(x.frames[t].position, y.frames[t].position);
  }
}

TEST_F(Convert, ThereAndBackKeepsEveryBit) {
  for (const int dimensions : {2, 3})
    for (const DataSetFormat format : {DataSetFormat::gns, DataSetFormat::lagrangebench}) {
      const std::string own = own_set(dimensions), name = word_of(format) + std::to_string(dimensions);
      const std::string there = folder_.file(name), back = folder_.file(name + "-back");
      const ConversionResult result = convert(own, there, format);
      EXPECT_EQ(result.from, DataSetFormat::graupel);
      EXPECT_EQ(result.splits.at("train").trajectories, 2);
      EXPECT_EQ(metadata(there)["dim"], dimensions);
      convert(there, back, DataSetFormat::graupel);
      for (const char* split : {"/train.h5", "/valid.h5", "/test.h5"}) expect_same_runs(own + split, back + split);
    }
}

TEST_F(Convert, BetweenTheOthersKeepsEveryBit) {
  convert(own_set(3), folder_.file("gns"), DataSetFormat::gns);
  convert(folder_.file("gns"), folder_.file("bench"), DataSetFormat::lagrangebench);
  convert(folder_.file("bench"), folder_.file("gns2"), DataSetFormat::gns);
  const auto one = open_gns_split(folder_.file("gns/train.npz")),
             other = open_gns_split(folder_.file("gns2/train.npz"));
  for (int64_t i = 0; i < 2; ++i) EXPECT_TRUE(same_values(one->read(i), other->read(i)));
  EXPECT_EQ(open_lagrangebench_split(folder_.file("bench/train.h5"))->read(0).particle_type,
            (std::vector<int64_t>{0, 6, 0, 6, 6}));
}

TEST_F(Convert, StatisticsAreThoseOfOurOwnMetadata) {
  const std::string own = own_set(3);
  convert(own, folder_.file("gns"), DataSetFormat::gns);
  convert(own, folder_.file("bench"), DataSetFormat::lagrangebench);
  for (const char* key :
       {"vel_mean", "vel_std", "acc_mean", "acc_std", "bounds", "default_connectivity_radius", "dt"}) {
    EXPECT_EQ(metadata(folder_.file("gns"))[key], metadata(own)[key]) << key;
    EXPECT_EQ(metadata(folder_.file("bench"))[key], metadata(own)[key]) << key;
  }
  EXPECT_EQ(metadata(folder_.file("bench"))["dx"], metadata(own)["dx"]);
}

TEST_F(Convert, ScenesComeBackWithWallsGravityAndGrid) {
  for (const int dimensions : {2, 3}) {
    const std::string to = folder_.file("gns" + std::to_string(dimensions));
    convert(own_set(dimensions), to, DataSetFormat::gns);
    convert(to, to + "-back", DataSetFormat::graupel);
    const TrajectoryReader reader(to + "-back/train.h5");
    const Scene was = parse_scene(scene_text(dimensions), "test", "");
    const Scene is = parse_stored_scene(reader.header(1).scene_json, "test", "");
    EXPECT_EQ(is.domain.dimensions, dimensions);
    EXPECT_EQ(is.domain.dx, was.domain.dx);
    EXPECT_EQ(is.gravity, was.gravity);
    EXPECT_EQ(is.frame_time, was.frame_time);
    EXPECT_EQ(is.domain.plane(), was.domain.plane());
    for (int axis = 0; axis < dimensions; ++axis) {
      EXPECT_NEAR(is.wall_low()[axis], was.wall_low()[axis], 1e-15);
      EXPECT_NEAR(is.wall_high()[axis], was.wall_high()[axis], 1e-15);
    }
    ASSERT_EQ(is.sources.size(), 2u);  // water and sand, where their particles are
    EXPECT_TRUE(is.obstacles.empty());
    EXPECT_EQ(reader.header(1).made_by, "converted from gns");
    const auto card = Json::parse(read_file(to + "-back/dataset.json"));
    EXPECT_EQ(card["converted_from"]["format"], "gns");
  }
}

TEST_F(Convert, StartVelocitiesAreTheFirstDifferences) {
  convert(own_set(3), folder_.file("gns"), DataSetFormat::gns);
  convert(folder_.file("gns"), folder_.file("back"), DataSetFormat::graupel);
  const TrajectoryReader reader(folder_.file("back/test.h5"));
  const auto frames = reader.frames(0, 0, 2);
  const auto velocity = reader.initial_velocity(0);
  ASSERT_EQ(velocity.size(), 5u);
  for (std::size_t p = 0; p < 5; ++p)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(velocity[p][axis], (frames[1].position[p][axis] - frames[0].position[p][axis]) / 0.02, 1e-4);
}

/// A gns data set of one split.
std::string gns_set(const TemporaryFolder& folder, const ParticleSeries& series, const Json& changes = {}) {
  const std::string set = folder.file("foreign");
  make_folder(set);
  write_gns_split(set + "/train.npz", 1, [&](int64_t) { return series; });
  Json json = Json::parse(R"({"bounds": [[0, 8], [0, 8]], "sequence_length": null, "dim": 2, "dt": 0.0025,
    "default_connectivity_radius": 0.5, "vel_mean": [0, 0], "vel_std": [1, 1], "acc_mean": [0, 0],
    "acc_std": [1, 1]})");
  if (changes.is_object()) json.update(changes);
  write_file_atomically(set + "/metadata.json", json.dump());
  return set;
}

TEST_F(Convert, ForeignDataGetAScene) {
  ParticleSeries series = sample_series(4, 6, 2);
  series.material_property = {1, 2, 3, 4, 5, 6};
  series.particle_type[0] = 3;
  const std::string to = folder_.file("own");
  convert(gns_set(folder_, series), to, DataSetFormat::graupel, [](ConversionOptions& options) {
    options.set = {"gravity=[0,-1,0]"};
    options.types = "6=snow";
  });
  const TrajectoryReader reader(to + "/train.h5");
  const Trajectory run = reader.read(0);
  EXPECT_EQ(run.particle_type, (std::vector<int32_t>{3, 8, 5, 8, 5, 8}));
  EXPECT_DOUBLE_EQ(run.frames[3].time, 0.0075);
  EXPECT_EQ(run.frames[0].position[1], (Vec3f{0.25f, 0.3125f, 0.5f}));
  const Scene scene = parse_stored_scene(run.scene_json, "test", "");
  EXPECT_TRUE(scene.domain.is_plane());
  EXPECT_EQ(scene.gravity, (Vec3d{0, -1, 0}));
  EXPECT_NEAR(scene.domain.dx, 0.5 / 2.24, 1e-15);
  // and what GNS alone knows goes back with it
  convert(to, folder_.file("again"), DataSetFormat::gns, [](ConversionOptions& options) { options.types = "6=snow"; });
  EXPECT_TRUE(same_values(open_gns_split(folder_.file("again/train.npz"))->read(0), series));
  EXPECT_EQ(metadata(folder_.file("again"))["material_feature_len"], 1);
}

TEST_F(Convert, PeriodicWallsStay) {
  ParticleSeries series = sample_series(3, 1, 2);
  series.position = {7.5f, 1, 7.9f, 1, 0.3f, 1};  // through the wall at 8
  series.particle_type = {0};
  const std::string set = folder_.file("bench");
  make_folder(set);
  write_lagrangebench_split(set + "/train.h5", 1, [&](int64_t) { return series; });
  Json json = Json::parse(read_file(gns_set(folder_, series) + "/metadata.json"));
  json["periodic_boundary_conditions"] = {true, false};
  write_file_atomically(set + "/metadata.json", json.dump());
  convert(set, folder_.file("own"), DataSetFormat::graupel);
  const TrajectoryReader reader(folder_.file("own/train.h5"));
  const Scene scene = parse_stored_scene(reader.header(0).scene_json, "test", "");
  EXPECT_EQ(scene.domain.wall(0, 1), Wall::periodic);
  EXPECT_EQ(scene.domain.wall(1, 0), Wall::separate);
  EXPECT_NEAR(metadata(folder_.file("own"))["vel_mean"][0].get<double>(), 0.4, 1e-6);  // not -3.6
  convert(folder_.file("own"), folder_.file("back"), DataSetFormat::lagrangebench);
  EXPECT_EQ(metadata(folder_.file("back"))["periodic_boundary_conditions"], Json({true, false}));
  expect_error<InputError>([&] { convert(set, folder_.file("gns"), DataSetFormat::gns); }, {"periodic walls"});
}

TEST_F(Convert, FramesFromADivergenceOnAreLeftOut) {
  const std::string set = own_set(3);
  Trajectory header;
  header.particle_type = {5};
  header.frame_time = 0.02;
  header.scene_json = scene_text(3);
  TrajectoryWriter writer(set + "/test.h5", header, {.velocity = false});
  for (const float x : {1.0f, 1.5f, 1e30f}) {
    ParticleFrame frame;
    frame.position = {{x, 1, 1}};
    writer.append(frame);
  }
  writer.finish(2);
  convert(set, folder_.file("gns"), DataSetFormat::gns);
  const ParticleSeries series = open_gns_split(folder_.file("gns/test.npz"))->read(0);
  EXPECT_EQ(series.position, (std::vector<float>{1, 1, 1, 1.5f, 1, 1}));
  EXPECT_TRUE(metadata(folder_.file("gns"))["sequence_length"].is_null());
}

TEST_F(Convert, ChosenSplitsAlone) {
  const auto result = convert(own_set(3), folder_.file("gns"), DataSetFormat::gns,
                              [](ConversionOptions& options) { options.splits = {"test"}; });
  EXPECT_EQ(result.splits.size(), 1u);
  EXPECT_EQ(names_in(folder_.file("gns")), (std::vector<std::string>{"dataset.json", "metadata.json", "test.npz"}));
  expect_error<ConfigError>(
      [&] {
        convert(folder_.file("gns"), folder_.file("x"), DataSetFormat::graupel,
                [](ConversionOptions& options) { options.splits = {"train"}; });
      },
      {"--split train is not in"});
}

TEST_F(Convert, ObstaclesAreCounted) {
  const std::string more = R"(, "obstacles": [{"shape": "sphere", "radius": 0.1, "position": [0.5, 0.5, 0.5]}])";
  EXPECT_EQ(convert(own_set(3, more), folder_.file("gns"), DataSetFormat::gns).with_obstacles, 2);
}

TEST_F(Convert, BadInputLeavesNothing) {
  const auto before = [&] { return names_in(folder_.path()); };
  const auto refused = [&](const std::string& set, DataSetFormat format, const std::vector<std::string>& words,
                           const std::function<void(ConversionOptions&)>& more = {}) {
    const auto names = before();
    expect_error<Error>([&] { convert(set, folder_.file("out"), format, more); }, words);
    EXPECT_EQ(before(), names) << words.front();
  };
  const ParticleSeries good = sample_series(4, 6, 2);
  ParticleSeries bad = good;
  bad.position[17] = std::numeric_limits<float>::quiet_NaN();
  refused(gns_set(folder_, bad), DataSetFormat::graupel, {"not finite (frame 1, particle 2)"});
  bad = good;
  bad.particle_type = {5, 0, 1, 5, 5, 5};
  refused(gns_set(folder_, bad), DataSetFormat::graupel, {"simulation_trajectory_0", "types 0, 1 of gns"});
  bad.particle_type.assign(6, 3);
  refused(gns_set(folder_, bad), DataSetFormat::graupel, {"obstacle particles alone"});
  refused(gns_set(folder_, sample_series(4, 6, 3)), DataSetFormat::graupel, {"has 3 dimensions", "dim 2"});
  refused(gns_set(folder_, good, {{"dt", 0}}), DataSetFormat::graupel, {"'dt' is 0"});
  refused(gns_set(folder_, good), DataSetFormat::gns, {"of the format gns already"});
  refused(gns_set(folder_, good), DataSetFormat::lagrangebench, {"--set changes the scenes"},
          [](ConversionOptions& options) { options.set = {"gravity=[0,0,0]"}; });
  refused(gns_set(folder_, good), DataSetFormat::graupel, {"domain.dx"},
          [](ConversionOptions& options) { options.set = {"domain.dx=-1"}; });
  refused(folder_.path(), DataSetFormat::graupel, {"holds no data set"});
  refused(folder_.file("nowhere"), DataSetFormat::graupel, {"is no folder"});
  const std::string set = gns_set(folder_, good);
  folder_.write("foreign/valid.h5", bytes_of(own_set(3) + "/valid.h5"));
  refused(set, DataSetFormat::graupel, {"holds data of two formats"});
  refused(own_set(3), DataSetFormat::gns, {"stopped here"}, [](ConversionOptions& options) {
    options.progress = [](int64_t, int64_t) { throw Error(ExitCode::interrupted, "stopped here"); };
  });
}

TEST_F(Convert, OwnDataThatOthersCannotHoldAreRefused) {
  const std::string set = own_set(3);
  const auto refused = [&](const std::vector<std::string>& words) {
    expect_error<Error>([&] { convert(set, folder_.file("out"), DataSetFormat::gns); }, words);
  };
  Trajectory header;
  header.particle_type = {5};
  header.frame_time = 0.02;
  ParticleFrame frame;
  frame.position = {{1, 1, 1}};
  const auto write = [&](const TrajectoryWriteOptions& options) {
    TrajectoryWriter writer(set + "/train.h5", header, options);
    writer.append(frame);
    writer.finish();
  };
  write({.velocity = false});
  refused({"trajectory 0 has no scene"});
  header.scene_json = scene_text(3);
  write({.velocity = false, .active = true});
  refused({"particles that come or go"});
  header.scene_json = scene_text(2);
  write({.velocity = false});
  refused({"other walls, dimensions or frame times"});
  header.scene_json = "{";
  write({.velocity = false});
  refused({"has a damaged scene"});
  header.scene_json = scene_text(3);
  header.particle_type = {10};
  write({.velocity = false});
  refused({"(metal)"});
  remove_path(set + "/metadata.json");
  refused({"--connectivity-radius"});
}

TEST_F(Convert, OutputThatIsThereStays) {
  const std::string own = own_set(3);
  folder_.write("out/mine.txt", "mine");
  expect_error<ConfigError>([&] { convert(own, folder_.file("out"), DataSetFormat::gns); }, {"not empty"});
  EXPECT_EQ(bytes_of(folder_.file("out/mine.txt")), "mine");
  remove_path(folder_.file("out/mine.txt"));
  convert(own, folder_.file("out") + "/", DataSetFormat::gns);  // an empty folder is taken
  EXPECT_TRUE(std::filesystem::exists(folder_.file("out/train.npz")));
}

}  // namespace
}  // namespace graupel::io
