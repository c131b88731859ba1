// graupel validate and graupel doctor.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

using Json = nlohmann::json;

class Validate : public ::testing::Test {
 protected:
  Json report(const std::string& files, int exit_code) const {
    const std::string json = folder_.file("report.json");
    const Outcome outcome = graupel("validate " + files + " --json " + json);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.output;
    return Json::parse(read_file(json));
  }
  static std::size_t count_with(const Json& errors, const std::string& text) {
    std::size_t n = 0;
    for (const auto& error : errors) n += error.get<std::string>().find(text) != std::string::npos ? 1 : 0;
    return n;
  }

  Folder folder_;
};

TEST_F(Validate, TellsAllMistakesOfAScene) {
  const std::string file = folder_.write("bad.json", R"({
  "domain": { "dx": -1, "sise": [1, 1, 1] },
  "materials": { "water": { "preset": "taichi_water", "viscosity": "thick" }, "sand": { "preset": "sandd" } },
  "sources": [
    { "shape": "ball", "radius": 0.1, "position": [0.5, 0.5, 0.5], "material": "water" },
    { "shape": "sphere", "radius": -0.1, "position": [0.5, 0.5], "material": "water" }
  ],
  "frames": 1.5
})");
  const Json errors = report(file, 3)["files"][0]["errors"];
  EXPECT_EQ(count_with(errors, "bad.json:2: /domain/dx is out of range (-1"), 1u) << errors.dump(1);
  EXPECT_EQ(count_with(errors, "/domain/sise is not a known key"), 1u);
  EXPECT_EQ(count_with(errors, "/materials/water/viscosity must be a number"), 1u);
  EXPECT_EQ(count_with(errors, "/materials/sand/preset is not one of its words"), 1u);
  EXPECT_EQ(count_with(errors, "/sources/0/shape is not one of its words"), 1u);
  EXPECT_EQ(count_with(errors, "/sources/1/radius is out of range"), 1u);
  EXPECT_EQ(count_with(errors, "/sources/1/position must be a list of 3 numbers"), 1u);
  EXPECT_EQ(count_with(errors, "/frames must be a whole number"), 1u);
  EXPECT_EQ(errors.size(), 8u) << "mistakes that follow from others: " << errors.dump(1);
}

TEST_F(Validate, NamesThatLeadNowhereAreToldBesideOtherMistakes) {
  const std::string file = folder_.write("both.json", R"({
  "domain": { "foo": 2 },
  "materials": { "water": { "preset": "taichi_water", "viscosity": "thick" } },
  "sources": [
    { "shape": "mesh", "file": "no.obj", "position": [0.5, 0.5, 0.5], "material": "zz" },
    { "shape": "sphere", "radius": -1, "position": [0.5, 0.5, 0.5], "material": "water" }
  ],
  "obstacles": [ { "shape": "vdb", "file": "no.vdb", "scale": -1 } ]
})");
  const Json errors = report(file, 3)["files"][0]["errors"];
  for (const char* part :
       {"/domain/foo is not a known key", "/materials/water/viscosity must be a number",
        "/sources/0/material names no material of the scene (\"zz\", there are: water)", "(\"no.obj\", looked for at",
        "/sources/1/radius is out of range", "(\"no.vdb\", looked for at", "/obstacles/0/scale is out of range"})
    EXPECT_EQ(count_with(errors, part), 1u) << part << "\n" << errors.dump(1);
  EXPECT_EQ(errors.size(), 7u) << errors.dump(1);
}

TEST_F(Validate, WhatIsKnownIsToldWhenItIsStopped) {
  const std::string good = folder_.write("good.json", read_file("scenes/shared/water_steps.json"));
  const std::string pipe = folder_.file("pipe.json");  // nothing comes out of it
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string said = folder_.file("said.txt");
  run_program("/usr/bin/timeout",
              "-s TERM 8 " GRAUPEL_BINARY_DIR "/graupel validate " + good + " " + pipe + " > " + said);
  EXPECT_NE(read_file(said).find("good.json: ok"), std::string::npos);
}

TEST_F(Validate, TellsAllThatDoesNotFitTogether) {
  const std::string file = folder_.write("unfit.json", R"({
  "materials": { "water": { "preset": "taichi_water" } },
  "sources": [
    { "shape": "sphere", "radius": 0.1, "position": [0.5, 0.5, 0.5], "material": "watr" },
    { "shape": "mesh", "file": "nowhere.obj", "position": [0.5, 0.5, 0.5], "material": "water" }
  ],
  "obstacles": [ { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.1, 0.5], "rotation_axis": [0, 0, 0] } ],
  "time_step": { "min_step": 1e-2, "max_step": 1e-3 }
})");
  const Json errors = report(file, 3)["files"][0]["errors"];
  EXPECT_EQ(count_with(errors, "/sources/0/material names no material of the scene"), 1u) << errors.dump(1);
  EXPECT_EQ(count_with(errors, "nowhere.obj"), 1u);
  EXPECT_EQ(count_with(errors, "/obstacles/0/rotation_axis must not be zero"), 1u);
  EXPECT_EQ(count_with(errors, "/time_step/min_step must not be above max_step"), 1u);
  EXPECT_EQ(errors.size(), 4u);
}

TEST_F(Validate, GoodFilesOfEveryKindAreOk) {
  const Json all = report(
      "scenes/shared/water_steps.json scenes/recipes/general.json scenes/recipes/hgn.json "
      "scenes/recipes/nsf_jelly_quick.json models/gns.safetensors scenes/floors/demo.json",
      0);
  for (const auto& file : all["files"]) EXPECT_TRUE(file["errors"].empty()) << file.dump(1);
  EXPECT_EQ(all["files"].size(), 6u);
}

TEST_F(Validate, RecipesAndDamagedFiles) {
  const std::string recipe = folder_.write("recipe.json", R"({ "categories": ["dam_break", "flood"], "frames": -1,
    "max_particles": "many" })");
  const std::string damaged = folder_.write("damaged.safetensors", "0123456789");
  const Json files = report(recipe + " " + damaged, 3)["files"];
  EXPECT_EQ(files[0]["errors"].size(), 4u) << files.dump(1);
  EXPECT_EQ(count_with(files[1]["errors"], "is not a valid safetensors file"), 1u);
  const std::string header =
      R"({"__metadata__":{"offline_cost":"cheap"},"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})";
  const std::string cheap = std::string(1, static_cast<char>(header.size())) + std::string(7, '\0') + header + "abcd";
  const Json cost = report(folder_.write("cost.safetensors", cheap), 3)["files"];
  EXPECT_EQ(count_with(cost[0]["errors"], "metadata offline_cost"), 1u) << cost.dump(1);
  const Json unknown = report(folder_.write("note.txt", "x") + " / " + damaged, 3)["files"];
  EXPECT_EQ(count_with(unknown[0]["errors"], "no known ending"), 1u) << unknown.dump(1);
  EXPECT_EQ(unknown[1]["errors"].size(), 1u);
  EXPECT_EQ(unknown[2]["errors"].size(), 1u);
}

TEST_F(Validate, AStoredSceneThatIsNoJson) {
  const std::string run = folder_.file("a.h5");
  {
    Trajectory header;
    header.particle_type = {5};
    header.scene_json = "{ \"frames\": 1";
    io::TrajectoryWriter writer(run, header, {});
    ParticleFrame frame;
    frame.position = frame.velocity = {{0.5f, 0.5f, 0.5f}};
    writer.append(frame);
    writer.finish();
  }
  const Json errors = report(run, 3)["files"][0]["errors"];
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(count_with(errors, "a.h5': trajectory 0 (its scene):1:"), 1u) << errors.dump(1);
  EXPECT_EQ(count_with(errors, "not valid JSON"), 1u);
}

TEST_F(Validate, MistakesThatQuoteMuchAreShortened) {
  const std::string much(1 << 20, 'm');
  const Json errors =
      report(folder_.write("long.json",
                           "{ \"materials\": { \"" + much +
                               "\": {} }, \"sources\": [ { \"shape\": \"box\", "
                               "\"size\": [0.1, 0.1, 0.1], \"position\": [0.5, 0.5, 0.5], \"material\": \"w\" } ] }"),
             3)["files"][0]["errors"];
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_LT(errors[0].get<std::string>().size(), 4000u);
  EXPECT_EQ(count_with(errors, "/sources/0/material names no material of the scene (\"w\", there are: mmm"), 1u);
  EXPECT_EQ(count_with(errors, "Use one of them or add it to 'materials'."), 1u);
}

TEST_F(Validate, EveryMistakeNamesItsFile) {
  const std::string inside = folder_.write("inside.json", small_scene(R"("obstacles": [ { "shape": "sphere",
    "radius": 0.2, "position": [0.5, 0.5, 0.5] } ])"));
  const Json errors = report("scenes/shared/water_steps.json " + inside, 3)["files"][1]["errors"];
  EXPECT_EQ(count_with(errors, "inside.json': "), 1u) << errors.dump(1);
  const std::string colored = folder_.write("a\033[31m.json", small_scene());
  const Outcome ok = graupel("validate '" + colored + "'");
  EXPECT_TRUE(ok.says("a?[31m.json: ok")) << ok.output;
}

TEST(Doctor, TellsTheMachineAndWhatMakesItSlow) {
  const Folder folder;
  const Outcome usual = graupel("doctor");
  ASSERT_EQ(usual.exit_code, 0) << usual.output;
  for (const char* words : {"processor", "instruction set", "GPU", "libhdf5", "libopenvdb", "times that of one"})
    EXPECT_TRUE(usual.says(words)) << words << "\n" << usual.output;

  const Outcome slow = run_program("/usr/bin/env", "GRAUPEL_SIMD=baseline GRAUPEL_PRODUCTS=f32 " GRAUPEL_BINARY_DIR
                                                   "/graupel doctor --threads 1 --json " +
                                                       folder.file("doctor.json"));
  ASSERT_EQ(slow.exit_code, 0) << slow.output;
  const Json report = Json::parse(read_file(folder.file("doctor.json")));
  EXPECT_EQ(report["facts"]["arithmetic of all threads"], "1.0 times that of one");
  EXPECT_NE(report["facts"]["instruction set"].get<std::string>().find("baseline"), std::string::npos);
  if (report["facts"]["instruction set"].get<std::string>().find("avx2") != std::string::npos) {
    EXPECT_NE(slow.output.find("Unset GRAUPEL_SIMD"), std::string::npos) << slow.output;
  }
}

TEST(Doctor, TellsWhereTheCheckersAreAndWhetherTheyRun) {
  const Outcome usual = graupel("doctor");
  for (const char* words :
       {GRAUPEL_BINARY_DIR "/graupel-check-hdf5 runs", GRAUPEL_BINARY_DIR "/graupel-check-vdb runs"})
    EXPECT_TRUE(usual.says(words)) << words << "\n" << usual.output;
  const auto doctor_with = [](const std::string& checkers) {
    return run_program("/usr/bin/env", "GRAUPEL_CHECKERS=" + checkers + " " GRAUPEL_BINARY_DIR "/graupel doctor");
  };
  const Outcome missing = doctor_with("/no/such/folder");
  EXPECT_EQ(missing.exit_code, 0);
  for (const char* words :
       {"not there", "no HDF5 file can be read", "no VDB file can be read", "Name the folder that has it"})
    EXPECT_TRUE(missing.says(words)) << words << "\n" << missing.output;
  EXPECT_TRUE(doctor_with("none").says("off (GRAUPEL_CHECKERS=none)"));
}

}  // namespace
}  // namespace graupel::test
