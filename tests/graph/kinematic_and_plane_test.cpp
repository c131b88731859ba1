// Rollouts with kinematic particles, and rollouts in the plane.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/features/prescribed_positions.h"
#include "graph/learned_simulator.h"
#include "random_input.h"

namespace graupel::graph {
namespace {

constexpr double frame_time = 1.0 / 60;

Normalization small_motion() {
  Normalization n;
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_std[axis] = 0.01f;
    n.acceleration_std[axis] = 1e-4f;
  }
  return n;
}

HgnConfig small_config(int64_t dimensions) {
  HgnConfig config;
  config.latent = 16;
  config.levels = 2;
  config.message_passing = 2;
  config.embedding = 4;
  config.history = 3;
  config.dimensions = dimensions;
  return config;
}

LearnedSimulator simulator(int64_t dimensions) {
  const std::string file =
      (std::filesystem::temp_directory_path() / ("graupel_held_" + std::to_string(::getpid()) + ".safetensors"))
          .string();
  nn::write_safetensors(file, random_weights(small_config(dimensions), small_motion()));
  LearnedSimulator made(file);
  std::filesystem::remove(file);
  return made;
}

Scene scene_of(int64_t dimensions, double depth = 1) {
  Scene scene;
  scene.domain.dimensions = dimensions;
  scene.domain.size[2] = depth;
  scene.domain.origin[2] = -depth / 2;
  scene.source = "{}";
  return scene;
}

/// 40 particles of which every fourth is of an obstacle and every eighth stationary.
struct Start {
  explicit Start(const Scene& scene) {
    auto x = blobs(2, 40, 0.05);
    if (scene.domain.is_plane())
      for (Vec3f& p : x) p[2] = static_cast<float>(scene.domain.plane());
    for (int i = 0; i < 40; ++i) type.push_back(i % 8 == 0 ? 13 : i % 4 == 0 ? obstacle_particle_type : 5);
    history = start_history(x, std::vector<Vec3f>(40, Vec3f{0.1f, -0.2f, 0}), scene.gravity, frame_time, 4,
                            kinematic_mask(type));
  }
  std::vector<int32_t> type;
  std::vector<std::vector<Vec3f>> history;
};

LearnedSimulator::RolloutOptions frames(int64_t count) {
  LearnedSimulator::RolloutOptions options;
  options.frames = count;
  return options;
}

TEST(KinematicParticles, HistoryOfHeldParticlesIsNotBallistic) {
  const Scene scene = scene_of(3);
  const Start start(scene);
  for (std::size_t i = 0; i < 40; ++i) {
    const auto& h = start.history;
    const double second = h[3][i][1] - 2.0 * h[2][i][1] + h[1][i][1];
    EXPECT_NEAR(second, moves_by_itself(start.type[i]) ? -9.8 * frame_time * frame_time : 0, 2e-7);
  }
}

TEST(KinematicParticles, AreWhereTheDataHaveThemAndStayBeyond) {
  const LearnedSimulator network = simulator(3);
  const Scene scene = scene_of(3);
  const Start start(scene);
  const Environment environment(scene);
  LearnedSimulator::GivenFrames given(3, start.history.back());
  for (std::size_t f = 0; f < given.size(); ++f)
    for (Vec3f& x : given[f]) x[0] += 0.01f * static_cast<float>(f + 1);
  auto options = frames(5);
  options.given = &given;
  const Trajectory moved = network.rollout(scene, environment, start.type, start.history, options);
  options.given = nullptr;
  const Trajectory still = network.rollout(scene, environment, start.type, start.history, options);
  ASSERT_EQ(moved.frame_count(), 6u);
  bool others_differ = false;
  for (std::size_t f = 1; f < 6; ++f)
    for (std::size_t i = 0; i < 40; ++i) {
      if (moves_by_itself(start.type[i])) {
        EXPECT_NE(moved.frames[f].position[i], moved.frames[0].position[i]);
        others_differ = others_differ || moved.frames[f].position[i] != still.frames[f].position[i];
        continue;
      }
      EXPECT_EQ(moved.frames[f].position[i], given[std::min<std::size_t>(f, 3) - 1][i]);
      EXPECT_EQ(still.frames[f].position[i], start.history.back()[i]);
    }
  EXPECT_TRUE(others_differ) << "others meet them";
}

TEST(KinematicParticles, NothingIsPredictedOfThem) {
  const Scene scene = scene_of(3);
  const Start start(scene);
  const auto acceleration = simulator(3).one_step(Environment(scene), start.type, start.history);
  for (std::size_t i = 0; i < 40; ++i) EXPECT_EQ(norm(acceleration[i]) == 0, !moves_by_itself(start.type[i])) << i;
}

/// The density that is held is that of the others: alone each of them is in cells of its own, with 20 held ones about
/// it, or among them, they would be pushed away.
TEST(KinematicParticles, AreNoMatterThatIsTooDense) {
  Scene scene = scene_of(3);
  scene.sources.emplace_back();
  scene.sources.back().particles_per_cell = 0.01;  // at rest one in each of the network's cells, as half of them have
  const Environment environment(scene);
  std::vector<Vec3f> position;
  for (int i = 0; i < 27; ++i)
    position.push_back({0.4f + 0.1f * static_cast<float>(i % 3), 0.4f + 0.1f * static_cast<float>(i / 3 % 3),
                        -0.1f + 0.1f * static_cast<float>(i / 9)});
  std::vector<int32_t> type(27, 5);
  for (const Vec3f& offset : blobs(1, 20, 0.01)) position.push_back(position[4] + (offset - blobs(1, 20, 0.01)[0]));
  type.resize(position.size(), obstacle_particle_type);
  const std::vector<std::vector<Vec3f>> history(4, position);
  const LearnedSimulator network = simulator(3);
  auto options = frames(2);
  options.project = false;
  const Trajectory with = network.rollout(scene, environment, type, history, options);
  options.density_limit = 0;
  const Trajectory without = network.rollout(scene, environment, type, history, options);
  EXPECT_TRUE(with.frames[2].position == without.frames[2].position);
  type.assign(type.size(), 5);
  const Trajectory matter = network.rollout(scene, environment, type, history, options);
  options.density_limit = 1;
  EXPECT_FALSE(network.rollout(scene, environment, type, history, options).frames[2].position ==
               matter.frames[2].position)
      << "as matter they are";
}

TEST(KinematicParticles, FramesOfAnotherNumberOfParticlesAreRefused) {
  const LearnedSimulator::GivenFrames given(2, std::vector<Vec3f>(3));
  EXPECT_THROW(PrescribedPositions({5, 3}, std::vector<Vec3f>(2), &given), InputError);
}

TEST(Plane, RolloutsStayInIt) {
  const LearnedSimulator network = simulator(2);
  const Scene scene = scene_of(2);
  Start start(scene);
  for (int32_t& type : start.type) type = 5;
  const Trajectory run = network.rollout(scene, Environment(scene), start.type, start.history, frames(10));
  ASSERT_EQ(run.frame_count(), 11u);
  double farthest = 0;
  for (const ParticleFrame& frame : run.frames)
    for (std::size_t i = 0; i < 40; ++i) {
      EXPECT_EQ(frame.position[i][2], static_cast<float>(scene.domain.plane()));
      farthest = std::max<double>(farthest, norm(frame.position[i] - run.frames[0].position[i]));
    }
  EXPECT_GT(farthest, 0.01);
}

/// Neither where the plane lies nor how deep the domain is changes anything.
TEST(Plane, HasNoThirdCoordinate) {
  const LearnedSimulator network = simulator(2);
  const Scene scene = scene_of(2);
  Scene other = scene_of(2, 0.1);
  other.domain.origin[2] = 7.3;
  const Start start(scene), moved(other);
  const auto a = network.one_step(Environment(scene), start.type, start.history);
  const auto b = network.one_step(Environment(other), start.type, moved.history);
  double largest = 0;
  for (std::size_t i = 0; i < 40; ++i) {
    EXPECT_EQ(a[i][2], 0);
    for (int d = 0; d < 2; ++d) EXPECT_NEAR(a[i][d], b[i][d], 2e-6 * 1e-4 * 10);
    largest = std::max<double>(largest, norm(a[i]));
  }
  EXPECT_GT(largest, 1e-5);
}

/// An obstacle is what the plane cuts of it: normals lie in the plane.
TEST(Plane, NormalsOfObstaclesLieInIt) {
  Scene scene = scene_of(2);
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.2;
  ball.position = {0.5, 0.5, scene.domain.plane() - 0.05};
  scene.obstacles.push_back(ball);
  const Environment environment(scene);
  FeatureConfig config;
  config.history = 1;
  config.signed_distance = true;
  config.dimensions = 2;
  const std::vector<Vec3f> x = {{0.692f, 0.5f, static_cast<float>(scene.domain.plane())}};
  const auto row = particle_features(config, {}, environment, {x, x});
  const std::size_t walls = 6, distance = walls + 6;  // after a velocity and a normal
  for (const std::size_t normal : {std::size_t{3}, distance + 1}) {
    EXPECT_EQ(row[normal + 2], 0);
    EXPECT_NEAR(row[normal] * row[normal] + row[normal + 1] * row[normal + 1], 1, 1e-5);
    EXPECT_GT(row[normal], 0.9);
  }
  for (const std::size_t face : {walls + 2, walls + 5}) EXPECT_EQ(row[face], 1) << "no walls along z";
}

TEST(Plane, WeightsAreOfOneNumberOfDimensions) {
  const Scene plane = scene_of(2), space = scene_of(3);
  const Start in_plane(plane), in_space(space);
  EXPECT_THROW(simulator(3).rollout(plane, Environment(plane), in_plane.type, in_plane.history, frames(1)),
               ConfigError);
  EXPECT_THROW(simulator(2).rollout(space, Environment(space), in_space.type, in_space.history, frames(1)),
               ConfigError);
  EXPECT_THROW(simulator(2).one_step(Environment(space), in_space.type, in_space.history), ConfigError);
  EXPECT_EQ(simulator(2).weights().metadata.at("hgn.dimensions"), "2");
  HgnConfig config = small_config(2);
  auto metadata = config.to_metadata();
  metadata.erase("hgn.dimensions");
  EXPECT_EQ(HgnConfig::from_metadata(metadata, "old").dimensions, 3);
}

}  // namespace
}  // namespace graupel::graph
