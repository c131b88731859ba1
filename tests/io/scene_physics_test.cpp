// Walls, scripts, emitters, sinks, transfers and steps of a scene: what is read, and every rule once broken.
#include <gtest/gtest.h>

#include "core/scene/scripts.h"
#include "core/system/error.h"
#include "expect_error.h"
#include "io/scene/scene_reader.h"
#include "replaced.h"

namespace graupel::io {
namespace {

const std::string good = R"({
  "domain": {"dx": 0.02, "wall_friction": 0.2,
    "faces": {"x_low": {"kind": "periodic"}, "x_high": {"kind": "periodic"},
              "y_low": {"kind": "slip", "friction": 0.4}, "y_high": {"kind": "open"}}},
  "materials": {"m": {"preset": "jelly"}},
  "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "material": "m", "position": [0.5, 0.5, 0.5],
               "angular_velocity": [0, 1, 0], "spin_center": [0.5, 0.5, 0.4],
               "motion": {"velocity": [0, 0.1, 0], "start_time": 0.1, "end_time": 0.2}, "release_time": 0.3}],
  "kinematic_regions": [{"shape": "half_space", "normal": [1, 0, 0], "position": [0.45, 0, 0], "motion": {}}],
  "emitters": [{"shape": "sphere", "radius": 0.1, "material": "m", "velocity": [1, 0, 0], "end_time": 2, "rate": 50}],
  "sinks": [{"shape": "sphere", "radius": 0.1, "position": [0.9, 0.2, 0.5]}],
  "obstacles": [{"shape": "box", "size": [0.2, 0.1, 0.1],
                 "motion": {"kind": "keyframes", "axis": [0, 0, 1],
                            "keyframes": [{"time": 1, "angle": 90}, {"time": 2, "translation": [0, 1, 0]}]}}],
  "transfer": {"scheme": "rpic", "damping": 5},
  "time_step": {"min_step": 1e-6}
})";

Scene parse(const std::string& text) { return parse_scene(text, "s.json", "/"); }

void fails(const std::string& from, const std::string& to, const std::vector<std::string>& parts) {
  expect_error<ConfigError>([&] { parse(replaced(good, from, to)); }, parts);
}

TEST(ScenePhysics, IsReadAndWrittenBack) {
  const Scene scene = parse(good);
  EXPECT_EQ(scene.domain.wall(0, 0), Wall::periodic);
  EXPECT_EQ(scene.domain.wall(1, 0), Wall::slip);
  EXPECT_EQ(scene.domain.wall(1, 1), Wall::open);
  EXPECT_EQ(scene.domain.wall(2, 0), Wall::separate);
  EXPECT_EQ(scene.domain.friction(1, 0), 0.4);
  EXPECT_EQ(scene.domain.friction(2, 1), 0.2);
  EXPECT_EQ(scene.sources[0].angular_velocity, (Vec3d{0, 1, 0}));
  EXPECT_EQ(*scene.sources[0].spin_center, (Vec3d{0.5, 0.5, 0.4}));
  EXPECT_EQ(*scene.sources[0].motion->end_time, 0.2);
  EXPECT_EQ(*scene.sources[0].release_time, 0.3);
  EXPECT_EQ(scene.kinematic_regions[0].shape, RegionShape::half_space);
  EXPECT_EQ(*scene.emitters[0].rate, 50);
  EXPECT_EQ(scene.sinks[0].radius, 0.1);
  EXPECT_EQ(scene.obstacles[0].motion->keyframes[1].translation, (Vec3d{0, 1, 0}));
  EXPECT_EQ(scene.transfer.scheme, TransferScheme::rpic);
  EXPECT_EQ(scene.time_step.min_step, 1e-6);
  EXPECT_TRUE(scene.has_inactive_particles());
  EXPECT_TRUE(scene.has_moving_obstacles());
  EXPECT_TRUE(has_scripts(scene));
  for (const bool of_bodies : {true, false}) {
    Scene one = scene;
    if (of_bodies)
      one.kinematic_regions.clear();
    else
      one.sources[0].motion.reset();
    EXPECT_TRUE(has_scripts(one));
  }
  const std::string text = scene_to_json(scene);
  EXPECT_EQ(scene_to_json(parse(text)), text);
}

TEST(ScenePhysics, OldScenesHaveNoneOfIt) {
  const Scene scene = parse(
      R"({"domain": {"walls": "stick"}, "materials": {"m": {"preset": "jelly"}},
          "sources": [{"shape": "sphere", "radius": 0.1, "material": "m"}]})");
  for (int face = 0; face < 6; ++face) EXPECT_EQ(scene.domain.wall(face / 2, face % 2), Wall::stick);
  EXPECT_FALSE(scene.has_inactive_particles());
  EXPECT_FALSE(scene.has_moving_obstacles());
  EXPECT_FALSE(has_scripts(scene));
  EXPECT_EQ(scene.transfer.scheme, TransferScheme::apic);
}

TEST(ScenePhysics, WallsThatCannotBe) {
  fails(R"(, "x_high": {"kind": "periodic"})", "",
        {"/domain/faces/x_low/kind", "has no partner", "x_high is \"separate\""});
  fails(R"("dx": 0.02)", R"("dx": 0.019)", {"/domain/faces/x_low", "whole number of cells"});
  fails(R"("kind": "open")", R"("kind": "opne")", {"/domain/faces/y_high/kind", "open"});
  fails(R"("kind": "open")", R"("kind": "open", "friction": 1)", {"friction", "slip"});
  fails(R"("friction": 0.4)", R"("friction": -1)", {"/domain/faces/y_low/friction", ">= 0"});
}

const std::string plane = R"({
  "domain": {"dx": 0.02, "dimensions": 2, "size": [1, 1, 0.1]}, "gravity": [0, -9.8, 0],
  "materials": {"m": {"preset": "jelly"}},
  "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "material": "m", "position": [0.5, 0.5, 0.05],
               "velocity": [1, 2, 0], "angular_velocity": [0, 0, 1]}],
  "kinematic_regions": [{"shape": "half_space", "normal": [1, 0, 0], "motion": {"spin": 1, "axis": [0, 0, 1]}}],
  "emitters": [{"shape": "sphere", "radius": 0.1, "material": "m", "velocity": [3, 0, 0], "end_time": 2}],
  "obstacles": [{"shape": "box", "size": [0.2, 0.1, 0.1], "rotation_axis": [1, 0, 0], "rotation_angle": 30,
                 "motion": {"kind": "keyframes", "axis": [0, 0, 2],
                            "keyframes": [{"time": 1, "angle": 90}, {"time": 2, "translation": [4, 1, 0]}]}}],
  "transfer": {"spline": "cubic"}
})";

TEST(ScenePhysics, ScenesInThePlane) {
  const Scene scene = parse(plane);
  EXPECT_TRUE(scene.domain.is_plane());
  EXPECT_DOUBLE_EQ(scene.domain.plane(), 0.05);
  EXPECT_EQ(scene.transfer.spline, Spline::cubic);
  EXPECT_EQ(scene_to_json(parse(scene_to_json(scene))), scene_to_json(scene));
  EXPECT_EQ(parse(good).domain.dimensions, 3);
  EXPECT_EQ(parse(good).transfer.spline, Spline::quadratic);
}

TEST(ScenePhysics, WhatLeadsOutOfThePlane) {
  const auto fails_in_plane = [](const std::string& from, const std::string& to,
                                 const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { parse(replaced(plane, from, to)); }, parts);
  };
  fails_in_plane(R"("dimensions": 2)", R"("dimensions": 4)", {"/domain/dimensions", "4", "2", "3"});
  fails_in_plane(R"("size": [1, 1, 0.1])", R"("size": [1, 0.2, 0.1])", {"/domain/size", "along y", "at least 22"});
  fails_in_plane("[0, -9.8, 0]", "[0, 0, -9.8]", {"/gravity", "out of the plane", "-9.8", "domain.dimensions"});
  fails_in_plane("[1, 2, 0]", "[1, 2, 3]", {"/sources/0/velocity", "out of the plane", "[1, 2, 3]"});
  fails_in_plane(R"("angular_velocity": [0, 0, 1])", R"("angular_velocity": [0, 1, 1])",
                 {"/sources/0/angular_velocity", "turns out of the plane"});
  fails_in_plane(R"("spin": 1, "axis": [0, 0, 1])", R"("spin": 1, "axis": [0, 1, 1])",
                 {"/kinematic_regions/0/motion/axis", "turns out of the plane", "[0, 0, 1]"});
  fails_in_plane("[3, 0, 0]", "[3, 0, -1]", {"/emitters/0/velocity", "out of the plane"});
  fails_in_plane("[4, 1, 0]", "[4, 1, 1]", {"/obstacles/0/motion/keyframes/1/translation", "out of the plane"});
  fails_in_plane("[0, 0, 2]", "[0, 1, 0]", {"/obstacles/0/motion/axis", "turns out of the plane"});
  fails_in_plane(R"("spline": "cubic")", R"("spline": "cubik")", {"/transfer/spline", "cubic", "quadratic"});
}

const std::string pushed = R"({
  "domain": {"dx": 0.02}, "frames": 60, "gravity": [0, -5, 0],
  "gravity_keyframes": [{"time": 0.5, "gravity": [1, 0, 0]}, {"time": 0.75, "gravity": [0, 0, 3]}],
  "materials": {"m": {"preset": "jelly"}},
  "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "material": "m", "position": [0.5, 0.5, 0.5]}],
  "loads": [{"start": 0.25, "duration": 0.5, "place": [0.5, 0.55, 0.5], "radius": 0.05, "force": [2, 0, 1]},
            {"duration": 9, "place": [0.5, 0.5, 0.5], "radius": 1, "force": [0, 1, 0]}]
})";

TEST(ScenePhysics, LoadsAndGravityThatChanges) {
  const Scene scene = parse(pushed);
  ASSERT_EQ(scene.loads.size(), 2u);
  EXPECT_EQ(scene.loads[0].start, 0.25);
  EXPECT_EQ(scene.loads[0].force, (Vec3d{2, 0, 1}));
  EXPECT_EQ(scene.loads[1].start, 0);
  EXPECT_EQ(scene_to_json(parse(scene_to_json(scene))), scene_to_json(scene));
  EXPECT_EQ(scene.gravity_at(0), (Vec3d{0, -5, 0}));
  EXPECT_EQ(scene.gravity_at(0.25), (Vec3d{0.5, -2.5, 0}));
  EXPECT_EQ(scene.gravity_at(0.625), (Vec3d{0.5, 0, 1.5}));
  EXPECT_EQ(scene.gravity_at(2), (Vec3d{0, 0, 3}));
  EXPECT_EQ(scene.largest_gravity(), 5);
  EXPECT_FALSE(parse(good).has_changing_gravity());
}

/// Exact for straight lines, whether keys lie within the interval or not.
TEST(ScenePhysics, MeanGravityIsTheIntegralOfItsPath) {
  const Scene scene = parse(pushed);
  const auto mean = [&](double from, double dt) {
    return mean_gravity(scene.gravity, scene.gravity_keyframes, from, dt);
  };
  const auto expect_near = [](const Vec3d& a, const Vec3d& b) { EXPECT_LT(norm(a - b), 1e-14) << a[0] << " " << a[1]; };
  expect_near(mean(0, 0.5), {0.5, -2.5, 0});
  expect_near(mean(0.1, 0.2), scene.gravity_at(0.2));
  expect_near(mean(0.25, 0.5), {0.5 * 0.75 + 0.5 * 0.5, 0.5 * -1.25, 0.5 * 1.5});
  expect_near(mean(0, 1), 0.5 * Vec3d{0.5, -2.5, 0} + 0.25 * Vec3d{0.5, 0, 1.5} + 0.25 * Vec3d{0, 0, 3});
  EXPECT_EQ(mean_gravity({0, -9.8, 0}, {}, 3, 0.1), (Vec3d{0, -9.8, 0}));
  EXPECT_EQ(mean_gravity({0, -9.8, 0}, {{1, {0, -9.8, 0}}}, 0.3, 0.1), (Vec3d{0, -9.8, 0}));
}

/// The parts of a load in consecutive steps are its duration; a start at a step's end is the next one's, also where
/// rounding takes it before.
TEST(ScenePhysics, ALoadActsForItsDuration) {
  TimedLoad load;
  load.start = 0.1;
  load.duration = 0.25;
  const double dt = 0.1 / 3;
  double sum = 0;
  for (int k = 0; k < 20; ++k) sum += load.acts(k * dt, dt);
  EXPECT_NEAR(sum, 0.25, 1e-15);
  EXPECT_EQ(load.acts(0, dt), 0);
  EXPECT_EQ(load.acts(0.1 - dt, dt * (1 + 1e-12)), 0);
  EXPECT_EQ(load.acts(0.36, dt), 0);
  EXPECT_EQ(load.acts(0, 1), 0.35 - 0.1);
}

TEST(ScenePhysics, LoadsAndGravityThatCannotBe) {
  const auto fails_pushed = [](const std::string& from, const std::string& to, const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { parse(replaced(pushed, from, to)); }, parts);
  };
  fails_pushed(R"("radius": 0.05, )", "", {"/loads/0", "radius"});
  fails_pushed(R"("radius": 0.05)", R"("radius": 0)", {"/loads/0/radius", "> 0"});
  fails_pushed(R"(, "force": [2, 0, 1])", "", {"/loads/0", "force"});
  fails_pushed("[2, 0, 1]", "[0, 0, 0]", {"/loads/0/force", "zero", "[N]"});
  fails_pushed("[2, 0, 1]", "[2, 0]", {"/loads/0/force", "3"});
  expect_error<InputError>([&] { parse(replaced(pushed, "[2, 0, 1]", "[1e999, 0, 1]")); }, {"not valid JSON", "1e999"});
  expect_error<InputError>([&] { parse(replaced(pushed, "[2, 0, 1]", "[NaN, 0, 1]")); },
                           {"not valid JSON", "\"force\": [N"});
  fails_pushed(R"("duration": 0.5, )", "", {"/loads/0", "duration"});
  fails_pushed(R"("duration": 9)", R"("duration": -9)", {"/loads/1/duration", "> 0"});
  fails_pushed(R"("start": 0.25)", R"("start": -1)", {"/loads/0/start", ">= 0"});
  fails_pushed(R"("start": 0.25)", R"("start": 1)", {"/loads/0/start", "not within the run", "ends at 1 s", "frames"});
  fails_pushed("[0.5, 0.55, 0.5]", "[0.5, 1.2, 0.5]", {"/loads/0/place", "outside the walls", "0.26 m"});
  fails_pushed(R"("time": 0.75)", R"("time": 0.5)", {"/gravity_keyframes", "out of order", "0.5 s, above 0.5 s"});
  fails_pushed(R"("time": 0.5)", R"("time": 0)", {"/gravity_keyframes/0/time", "> 0"});
  fails_pushed(R"({"time": 0.5, )", "{", {"/gravity_keyframes/0", "time"});
  const std::string flat = replaced(plane, R"("transfer")", R"("loads": [{"duration": 1, "place": [0.5, 0.5, 0.05],
    "radius": 0.1, "force": [1, 0, 0]}], "gravity_keyframes": [{"time": 1, "gravity": [1, 0, 0]}], "transfer")");
  EXPECT_EQ(parse(flat).loads.size(), 1u);
  expect_error<ConfigError>([&] { parse(replaced(flat, R"("force": [1, 0, 0])", R"("force": [1, 0, 2])")); },
                            {"/loads/0/force", "out of the plane"});
  expect_error<ConfigError>([&] { parse(replaced(flat, R"("gravity": [1, 0, 0])", R"("gravity": [1, 0, 2])")); },
                            {"/gravity_keyframes/0/gravity", "out of the plane"});
}

TEST(ScenePhysics, ScriptsThatCannotBe) {
  fails(R"("end_time": 0.2)", R"("end_time": 0.05)", {"/sources/0/motion", "ends before it starts"});
  fails(R"("motion": {"velocity": [0, 0.1, 0], "start_time": 0.1, "end_time": 0.2}, "release_time")",
        R"("release_time")", {"/sources/0/release_time", "no effect without 'motion'"});
  fails(R"({"time": 1, "angle": 90})", R"({"time": 3, "angle": 90})", {"/obstacles/0/motion", "out of order", "key 1"});
  fails(R"({"time": 1, "angle": 90})", R"({"time": 0, "angle": 90})", {"/obstacles/0/motion/keyframes/0/time", "> 0"});
  fails(R"("axis": [0, 0, 1])", R"("axis": [0, 0, 0])", {"/obstacles/0/motion", "an axis that must not be zero"});
  fails(R"("axis": [0, 0, 1])", R"("velocity": [0, 0, 1])", {"velocity", "constant"});
  fails(R"([{"time": 1, "angle": 90}, {"time": 2, "translation": [0, 1, 0]}])", "[]", {"no poses"});
  fails(R"("motion": {}})", R"("motion": {}, "release_time": -1})", {"/kinematic_regions/0/release_time", ">= 0"});
  fails(R"("normal": [1, 0, 0])", R"("normal": [0, 0, 0])", {"/kinematic_regions/0/normal", "must not be zero"});
  fails(R"("shape": "half_space", "normal": [1, 0, 0])", R"("shape": "half_space")",
        {"/kinematic_regions/0", "lacks the key 'normal'"});
}

TEST(ScenePhysics, EmittersAndSinksThatCannotBe) {
  fails(R"("velocity": [1, 0, 0], )", "", {"/emitters/0", "needs a velocity"});
  fails(R"("end_time": 2, )", "", {"/emitters/0", "end_time"});
  fails(R"("end_time": 2, )", R"("start_time": 3, "end_time": 2, )", {"/emitters/0/end_time", "above start_time"});
  fails(R"("rate": 50)", R"("rate": 0)", {"/emitters/0/rate", "> 0"});
  fails(R"("end_time": 2, "rate": 50)", R"("emission": "burst", "times": [])",
        {"/emitters/0/times", "must not be empty"});
  fails(R"("end_time": 2, "rate": 50)", R"("emission": "burst", "times": [1, 1])",
        {"/emitters/0/times", "must ascend"});
  fails(R"("end_time": 2, "rate": 50)", R"("emission": "burst", "times": [-1])", {"/emitters/0/times/0", ">= 0"});
  fails(R"("rate": 50)", R"("particle_limit": 0)", {"/emitters/0/particle_limit", ">= 1"});
  fails(R"("material": "m", "velocity")", R"("material": "n", "velocity")",
        {"/emitters/0/material", "names no material"});
  fails(R"("shape": "sphere", "radius": 0.1, "material")", R"("shape": "plane", "material")",
        {"/emitters/0/shape", "cannot be filled"});
  fails(R"("radius": 0.1, "position": [0.9, 0.2, 0.5])", R"("radius": 0, "position": [0.9, 0.2, 0.5])",
        {"/sinks/0/radius", "> 0"});
}

TEST(ScenePhysics, TransfersAndStepsThatCannotBe) {
  fails(R"("scheme": "rpic", "damping": 5)", R"("scheme": "pic", "damping": 5)", {"damping", "apic"});
  fails(R"("damping": 5)", R"("damping": -5)", {"/transfer/damping", ">= 0"});
  fails(R"("min_step": 1e-6)", R"("min_step": 1)", {"/time_step/min_step", "above max_step"});
}

}  // namespace
}  // namespace graupel::io
