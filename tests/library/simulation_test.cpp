// Simulations and files through the public headers.
#include <graupel/io.h>
#include <graupel/mpm.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "tests/library/test_scenes.h"

namespace graupel {
namespace {

using test::spinning_block;

std::string temporary(const std::string& name) { return (std::filesystem::path(::testing::TempDir()) / name).string(); }

TEST(PublicSimulation, SpansAreThoseOfTheFrameAndFollowIt) {
  Simulation run(spinning_block("jelly"));
  const ParticleFrame start = run.frame();
  ASSERT_EQ(run.position().size(), run.particle_count());
  EXPECT_GT(run.particle_count(), 1000u);
  EXPECT_EQ(run.position()[7], start.position[7]);
  EXPECT_TRUE(run.active().empty());
  run.advance_frame();
  const ParticleFrame later = run.frame({ParticleField::stress});
  EXPECT_FALSE(run.position()[7] == start.position[7]);
  EXPECT_EQ(run.position()[7], later.position[7]);
  EXPECT_EQ(run.velocity()[7], later.velocity[7]);
  const std::span<const float> stress = run.field(ParticleField::stress);
  ASSERT_EQ(stress.size(), 6 * run.particle_count());
  EXPECT_TRUE(std::equal(stress.begin(), stress.end(), later.fields[ParticleField::stress].begin()));
  EXPECT_NEAR(run.time(), 1.0 / 60, 1e-12);
  EXPECT_EQ(run.substeps(), 40);
  EXPECT_EQ(run.particle_type()[0], particle_type_of(MaterialModel::jelly));
}

/// Of scenes that no reader has checked.
TEST(PublicSimulation, NumbersOutOfRangeAreRefused) {
  const auto expect_refused = [](const auto& change) {
    Scene scene = spinning_block("jelly");
    change(scene);
    EXPECT_THROW(Simulation run(scene), ConfigError);
  };
  expect_refused([](Scene& scene) { scene.frame_time = 0; });
  expect_refused([](Scene& scene) { scene.frame_time = -1; });
  expect_refused([](Scene& scene) { scene.time_step.substeps_per_frame = -3; });
  expect_refused([](Scene& scene) { scene.sources[0].particles_per_cell = -1; });
  expect_refused([](Scene& scene) { scene.sources[0].size = {-0.1, 0.1, 0.1}; });
  expect_refused([](Scene& scene) { scene.sources[0].velocity = {0, std::nan(""), 0}; });
}

TEST(PublicSimulation, SumsAreThoseOfTheBlock) {
  Simulation run(spinning_block("jelly"), {.f64 = true});
  const Balance start = run.balance();
  const double mass = 1000 * 0.16 * 0.08 * 0.08, inertia = mass * (0.16 * 0.16 + 0.08 * 0.08) / 12;
  EXPECT_NEAR(start.mass, mass, 0.02 * mass);
  EXPECT_NEAR(start.kinetic, 0.5 * inertia * 36, 0.05 * 0.5 * inertia * 36);
  EXPECT_EQ(start.elastic, 0);
  run.advance_frame();
  EXPECT_NEAR(run.balance().momentum[1] - start.momentum[1], -9.8 / 60 * start.mass, 1e-9);
}

TEST(PublicSimulation, ForcesOnWallsAreWhatTheBlockLosesOfItsMomentum) {
  Scene scene = spinning_block("jelly");
  scene.sources[0].velocity = {0, -5, 0};
  Simulation run(scene, {.f64 = true, .contact_forces = true});
  const Balance start = run.balance();
  Vec3d impulse = {0, 0, 0};
  for (int frame = 0; frame < 6; ++frame) {
    run.advance_frame();
    ASSERT_EQ(run.contact_forces().size(), contact_names(run.scene()).size());
    for (const ContactForce& on : run.contact_forces()) impulse += on.impulse;
  }
  const Vec3d gained = run.balance().momentum - start.momentum;
  EXPECT_LT(impulse[1], -0.1 * start.mass);
  EXPECT_NEAR(gained[1] + impulse[1], -9.8 * run.time() * start.mass, 1e-10);
  EXPECT_TRUE(Simulation(scene).contact_forces().empty());
}

TEST(PublicSimulation, ASceneMadeInCodeIsTheSceneOfItsText) {
  const Scene made = spinning_block("jelly");
  const Scene read = io::parse_scene(io::scene_to_json(made), "text", ".");
  Simulation one(made), other(read);
  one.advance_frame();
  other.advance_frame();
  EXPECT_TRUE(std::equal(one.position().begin(), one.position().end(), other.position().begin()));
}

TEST(PublicSimulation, ChecksOfSceneFilesHoldForScenesMadeInCode) {
  Scene scene = spinning_block("jelly");
  scene.sources[0].material = "jely";
  EXPECT_THROW(checked_scene(scene), ConfigError);
  scene = spinning_block("jelly");
  scene.domain.dx = -1;
  EXPECT_THROW(checked_scene(scene), ConfigError);
  scene = spinning_block("jelly");
  Obstacle mesh;
  mesh.shape = Shape::mesh;
  mesh.file = "no_such.obj";
  scene.obstacles.push_back(mesh);
  EXPECT_THROW(checked_scene(scene), InputError);
}

TEST(PublicSimulation, OwnMeshesInMemoryAreObstacles) {
  Scene scene = spinning_block("jelly");
  Obstacle floor;
  floor.shape = Shape::mesh;
  TriangleMesh mesh;  // a tetrahedron with its tip up
  mesh.vertices = {{-0.2, 0, -0.15}, {0.2, 0, -0.15}, {0, 0, 0.2}, {0, 0.1, 0}};
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}};
  floor.mesh = std::make_shared<TriangleMesh>(mesh);
  floor.position = {0.24, 0.1, 0.24};
  scene.obstacles.push_back(floor);
  Simulation with(scene), without(spinning_block("jelly"));
  for (int frame = 0; frame < 10; ++frame) with.advance_frame(), without.advance_frame();
  double lifted = 0;
  for (std::size_t i = 0; i < with.particle_count(); ++i)
    lifted = std::max<double>(lifted, with.position()[i][1] - without.position()[i][1]);
  EXPECT_GT(lifted, 0.01);
}

TEST(PublicSimulation, ASavedStateGoesOnToTheByte) {
  Simulation run(spinning_block("sand"));
  run.advance_frame();
  const auto state = run.save_state();
  run.advance_frame();
  Simulation other(spinning_block("sand"));
  EXPECT_FALSE(other.position()[0] == run.position()[0]);
  other.load_state(state);
  other.advance_frame();
  EXPECT_TRUE(std::equal(run.position().begin(), run.position().end(), other.position().begin()));
  Simulation foreign(spinning_block("jelly"));
  EXPECT_THROW(foreign.load_state(state), InputError);
}

TEST(PublicSimulation, TrajectoriesAreReadAsTheyWereWritten) {
  const std::string file = temporary("public_library.h5");
  Simulation run(spinning_block("water"), {.seed = 5});
  {
    io::TrajectoryWriter writer(file, run.header());
    for (int frame = 0; frame < 3; ++frame) {
      if (frame > 0) run.advance_frame();
      writer.append(run.frame());
    }
    writer.finish();
  }
  const io::TrajectoryReader reader(file);
  EXPECT_TRUE(reader.complete());
  const Trajectory read = reader.read(0);
  EXPECT_EQ(read.seed, 5u);
  ASSERT_EQ(read.frame_count(), 3u);
  EXPECT_TRUE(std::equal(run.position().begin(), run.position().end(), read.frames[2].position.begin()));
  const Scene scene = io::parse_stored_scene(read.scene_json, file, file);
  EXPECT_EQ(scene.sources.size(), 1u);
  std::filesystem::remove(file);
}

TEST(PublicSimulation, TheStoredSceneIsTheOneThatRan) {
  Scene scene = io::read_scene(GRAUPEL_SOURCE_DIR "/scenes/shared/water_steps.json");
  scene.gravity = {0, -3, 0};
  scene.frames = 7;
  const Simulation run(scene);
  const Scene stored = io::parse_stored_scene(run.header().scene_json, "stored", "stored.h5");
  EXPECT_EQ(stored.gravity[1], -3);
  EXPECT_EQ(stored.frames, 7);
}

TEST(PublicSimulation, ErrorsAreByKindWithTheProgramsMessages) {
  EXPECT_THROW(io::read_scene("no_such_scene.json"), InputError);
  EXPECT_THROW(io::TrajectoryReader("no_such.h5"), InputError);
  Scene scene = spinning_block("jelly");
  scene.time_step.substeps_per_frame = 1;
  Simulation run(scene);
  try {
    for (int frame = 0; frame < 50; ++frame) run.advance_frame();
    FAIL() << "a step far above the limit must diverge";
  } catch (const DivergedError& error) {
    EXPECT_EQ(error.code(), ExitCode::diverged);
    EXPECT_NE(std::string(error.what()).find("'matter'"), std::string::npos) << error.what();
  }
  if (cuda_available()) GTEST_SKIP() << "there is a GPU";
  EXPECT_THROW(Simulation(spinning_block("jelly"), {.device = Device::cuda}), ConfigError);
}

}  // namespace
}  // namespace graupel
