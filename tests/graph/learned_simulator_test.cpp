#include <cmath>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "tests/graph/cuda/simulator_case.h"

namespace graupel::graph {
namespace {

TEST(StartHistory, FrameDifferencesGrowByGravityAndEndAtTheStart) {
  const std::vector<Vec3f> x = {{0.3f, 0.8f, 0.4f}}, v = {{0.5f, -1.0f, 0.25f}};
  const auto history = start_history(x, v, {0.1, gravity, 0}, frame_time, 6);
  ASSERT_EQ(history.size(), 6u);
  EXPECT_EQ(history[5], x);
  for (int k = 0; k < 6; ++k) {
    const double t = k * frame_time;
    EXPECT_NEAR(history[static_cast<std::size_t>(5 - k)][0][1], 0.8 + t + gravity * t * t / 2, 1e-6);
  }
  // The next frame of free flight continues the sequence: second differences are g dt^2 throughout.
  auto all = history;
  const double t = frame_time;
  all.push_back({{static_cast<float>(0.3 + 0.5 * t + 0.1 * t * t / 2),
                  static_cast<float>(0.8 - t + gravity * t * t / 2), static_cast<float>(0.4 + 0.25 * t)}});
  for (std::size_t f = 2; f < all.size(); ++f) {
    const Vec3f second = all[f][0] - all[f - 1][0] - (all[f - 1][0] - all[f - 2][0]);
    EXPECT_NEAR(second[0], 0.1 * t * t, 2e-7);
    EXPECT_NEAR(second[1], gravity * t * t, 2e-7);
    EXPECT_NEAR(second[2], 0, 2e-7);
  }
}

TEST(StartHistory, OneFrameIsTheStartItself) {
  const std::vector<Vec3f> x = {{1, 2, 3}};
  const auto history = start_history(x, x, {0, 0, 0}, frame_time, 1);
  ASSERT_EQ(history.size(), 1u);
  EXPECT_EQ(history[0], x);
}

TEST_F(LearnedSimulatorTest, OneStepUndoesTheNormalisation) {
  nn::Weights weights = random_weights(small_config(), free_flight());
  silence_decoder(weights);
  weights.tensors["decoder.layer2.bias"] = nn::Tensor::from_float({1, 2, -3}, {3});
  const LearnedSimulator simulator = make(weights);
  const Environment environment{Scene{}};
  const auto history =
      start_history(blobs(2, 30, 0.05), std::vector<Vec3f>(30, Vec3f::zero()), {0, 0, 0}, frame_time, 4);
  FrameTiming timing;
  const auto acceleration = simulator.one_step(environment, std::vector<int32_t>(30, 5), history, &timing);
  ASSERT_EQ(acceleration.size(), 30u);
  for (const Vec3f& a : acceleration) {
    EXPECT_NEAR(a[0], 0.001, 1e-8);
    EXPECT_NEAR(a[1], 0.002 + gravity * frame_time * frame_time, 1e-8);
    EXPECT_NEAR(a[2], -0.003, 1e-8);
  }
  EXPECT_GT(timing.network, 0);
  EXPECT_GT(timing.features, 0);
  EXPECT_GT(timing.hierarchy, 0);
}

TEST_F(LearnedSimulatorTest, WithoutTheNetworkGravityAndTheCorrectionsAreLeft) {
  Scene scene;
  const Environment environment(scene);
  const auto position = blobs(3, 50, 0.05);
  const auto start =
      start_history(position, std::vector<Vec3f>(50, Vec3f{0.3f, -4.0f, -0.2f}), scene.gravity, scene.frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 20;  // to the floor
  double wall = 0, parts = 0;
  options.progress = [&](int64_t, const FrameTiming& timing) {
    wall += timing.wall;
    parts += timing.total();
  };
  const std::vector<int32_t> type(50, 5);
  const Trajectory silent = make_ballistic().rollout(scene, environment, type, start, options);
  EXPECT_GE(wall, parts);  // the caller's clock has the integration, too
  EXPECT_LT(wall, 3 * parts);
  options.network = false;
  const Trajectory none =
      make(random_weights(small_config(), free_flight())).rollout(scene, environment, type, start, options);
  ASSERT_EQ(none.frames.size(), silent.frames.size());
  for (std::size_t f = 0; f < none.frames.size(); ++f)
    for (std::size_t i = 0; i < 50; ++i)
      ASSERT_LT(norm(none.frames[f].position[i] - silent.frames[f].position[i]), 1e-5f) << f;
  EXPECT_LT(none.frames.back().position[0][1], none.frames[5].position[0][1]);
}

TEST_F(LearnedSimulatorTest, ZeroOutputIsBallisticFlight) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  scene.source = "{}";
  scene.seed = 7;
  const Environment environment(scene);
  const auto position = blobs(3, 50, 0.05);
  const std::vector<Vec3f> velocity(50, Vec3f{0.3f, 1.0f, -0.2f});
  const auto start = start_history(position, velocity, scene.gravity, scene.frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 12;
  std::vector<int64_t> seen;
  options.progress = [&](int64_t frame, const FrameTiming&) { seen.push_back(frame); };
  const Trajectory t = simulator.rollout(scene, environment, std::vector<int32_t>(50, 6), start, options);
  ASSERT_EQ(t.frame_count(), 13u);
  EXPECT_EQ(seen.size(), 12u);
  EXPECT_EQ(seen.back(), 12);
  EXPECT_EQ(t.diverged_at_frame, -1);
  EXPECT_EQ(t.made_by, path_);
  EXPECT_EQ(t.scene_json, "{}");
  EXPECT_EQ(t.seed, 7u);
  EXPECT_EQ(t.particle_type, std::vector<int32_t>(50, 6));
  for (std::size_t f = 0; f < t.frame_count(); ++f) {
    const double time = static_cast<double>(f) * frame_time;
    EXPECT_NEAR(t.frames[f].time, time, 1e-9);
    for (std::size_t i = 0; i < 50; ++i) {
      EXPECT_NEAR(t.frames[f].position[i][0], position[i][0] + 0.3 * time, 1e-5);
      EXPECT_NEAR(t.frames[f].position[i][1], position[i][1] + time + gravity * time * time / 2, 1e-5);
      EXPECT_NEAR(t.frames[f].velocity[i][2], -0.2, 1e-4);
    }
  }
}

TEST_F(LearnedSimulatorTest, ProjectionKeepsParticlesOutOfObstaclesAndInsideTheWalls) {
  const LearnedSimulator simulator = make_ballistic();
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Environment environment(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 40;
  const Trajectory t = simulator.rollout(scene, environment, std::vector<int32_t>(100, 5), start, options);
  EXPECT_EQ(t.diverged_at_frame, -1);
  for (const ParticleFrame& frame : t.frames)
    for (const Vec3f& x : frame.position) {
      ASSERT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-6);
      ASSERT_GE(x[1], static_cast<float>(environment.hold_low[1]));
    }
  options.project = false;
  const Trajectory free = simulator.rollout(scene, environment, std::vector<int32_t>(100, 5), start, options);
  EXPECT_LT(free.frames.back().position[0][1], 0);
}

TEST_F(LearnedSimulatorTest, RolloutsHoldTheDensityLimit) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  scene.gravity = {0, gravity, 0};
  const Environment environment(scene);
  std::vector<Vec3f> position;
  for (int i = 0; i < 512; ++i)
    position.push_back(Vec3f{0.45f, 0.75f, 0.45f} + Vec3f{float(i % 8), float(i / 8 % 8), float(i / 64)} * (0.1f / 8));
  const auto start = start_history(position, std::vector<Vec3f>(512, Vec3f::zero()), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 2;
  const std::vector<int32_t> type(512, 5);
  // Largest distance to free flight along each axis.
  const auto off_course = [&](double limit) {
    options.density_limit = limit;
    const Trajectory t = simulator.rollout(scene, environment, type, start, options);
    Vec3d most = Vec3d::zero();
    for (std::size_t i = 0; i < position.size(); ++i) {
      Vec3d flight = position[i].cast<double>();
      flight[1] += gravity * frame_time * frame_time * 2;
      for (int d = 0; d < 3; ++d) most[d] = std::max(most[d], std::abs(double(t.frames[2].position[i][d]) - flight[d]));
    }
    return most;
  };
  for (int d = 0; d < 3; ++d) {
    EXPECT_LT(off_course(0)[d], 1e-6);
    EXPECT_LT(off_course(1.2)[d], 1e-6) << "never so dense";
    EXPECT_GT(off_course(0.1)[d], 0.02);
  }
}

TEST_F(LearnedSimulatorTest, ARolloutThatBlowsUpStopsAndSaysWhen) {
  nn::Weights weights = random_weights(small_config(), free_flight());
  silence_decoder(weights);
  weights.tensors["decoder.layer2.bias"] = nn::Tensor::from_float({300, 0, 0}, {3});  // 0.3 m a frame^2
  const LearnedSimulator simulator = make(weights);
  const Scene scene;
  const Environment environment(scene);
  const auto position = blobs(1, 20, 0.02);
  const auto start = start_history(position, std::vector<Vec3f>(20, Vec3f::zero()), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 30;
  options.project = false;
  options.free_flight = false;
  const Trajectory t = simulator.rollout(scene, environment, std::vector<int32_t>(20, 5), start, options);
  EXPECT_EQ(t.diverged_at_frame, 4);  // 0.3, 0.6, 0.9, 1.2 m a frame in a domain of 1 m
  EXPECT_EQ(t.frame_count(), 4u);
  for (const Vec3f& x : t.frames.back().position) EXPECT_TRUE(std::isfinite(x[0]));
}

GnsConfig small_gns() {
  GnsConfig config;
  config.latent = 16;
  config.message_passing = 2;
  config.embedding = 4;
  config.history = 3;
  config.obstacle_particles = true;
  config.obstacle_spacing = 1.0 / 32;
  return config;
}

TEST_F(LearnedSimulatorTest, AGnsRollsOutWithItsObstacleParticles) {
  nn::Weights weights = random_weights(small_gns(), free_flight());
  silence_decoder(weights);
  const LearnedSimulator ballistic = make(weights), random = make(random_weights(small_gns(), free_flight()));
  EXPECT_EQ(ballistic.config().history, 3);
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Environment environment(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 30;
  FrameTiming timing;
  options.progress = [&](int64_t, const FrameTiming& t) { timing = t; };
  const Trajectory t = ballistic.rollout(scene, environment, std::vector<int32_t>(100, 5), start, options);
  EXPECT_EQ(t.frame_count(), 31u);
  EXPECT_EQ(t.particle_count(), 100u);
  EXPECT_NEAR(t.frames[1].position[0][1], 0.7 - 2 * frame_time + gravity * frame_time * frame_time / 2, 1e-5);
  for (const Vec3f& x : t.frames.back().position) {
    EXPECT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-6);
  }
  EXPECT_GT(timing.network, 0);
  EXPECT_GT(timing.features, 0);
  EXPECT_GT(timing.hierarchy, 0);
  std::vector<Trajectory> runs;
  options.frames = 4;
  for (const int threads : {1, 3}) {
    set_num_threads(threads);
    runs.push_back(random.rollout(scene, environment, std::vector<int32_t>(100, 6), start, options));
  }
  set_num_threads(0);
  EXPECT_EQ(runs[0].frames.back().position, runs[1].frames.back().position);
  options.device = Device::cuda;
  try {
    random.rollout(scene, environment, std::vector<int32_t>(100, 6), start, options);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("Use device 'cpu'"), std::string::npos) << error.what();
  }
}

TEST_F(LearnedSimulatorTest, RolloutsDoNotDependOnTheNumberOfThreads) {
  const LearnedSimulator simulator = make(random_weights(small_config(), free_flight()));
  const Scene scene;
  const Environment environment(scene);
  const auto start =
      start_history(blobs(3, 400, 0.06), std::vector<Vec3f>(400, Vec3f::zero()), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 5;
  std::vector<Trajectory> runs;
  for (const int threads : {1, 2, 5}) {
    set_num_threads(threads);
    runs.push_back(simulator.rollout(scene, environment, std::vector<int32_t>(400, 8), start, options));
  }
  set_num_threads(0);
  EXPECT_EQ(runs[0].frames.back().position, runs[1].frames.back().position);
  EXPECT_EQ(runs[0].frames.back().position, runs[2].frames.back().position);
}

TEST_F(LearnedSimulatorTest, UnfitScenesStartsAndFilesAreErrors) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  const Environment environment(scene);
  const std::vector<Vec3f> position(3, Vec3f::filled(0.5f));
  const auto start = start_history(position, position, scene.gravity, frame_time, 4);
  const std::vector<int32_t> type(3, 5);
  LearnedSimulator::RolloutOptions options;
  options.frames = 1;
  EXPECT_NO_THROW(simulator.rollout(scene, environment, type, start, options));
  EXPECT_THROW(simulator.rollout(scene, environment, type, {start.begin() + 1, start.end()}, options), InputError);
  EXPECT_THROW(simulator.rollout(scene, environment, {5, 5}, start, options), InputError);
  auto broken = start;
  broken[1][2][0] = std::nanf("");
  EXPECT_THROW(simulator.rollout(scene, environment, type, broken, options), InputError);
  Scene slow = scene;
  slow.frame_time = 0.1;
  EXPECT_THROW(simulator.rollout(slow, environment, type, start, options), ConfigError);

  Scene fine;
  fine.domain.dx = 1.0 / 32;
  Obstacle box;
  box.position = {0.5, 0.2, 0.5};
  fine.obstacles.push_back(box);
  EXPECT_THROW(simulator.rollout(fine, Environment(fine), type, start, options), ConfigError);
  EXPECT_NO_THROW(simulator.rollout(fine, Environment(fine, simulator.config().dx), type, start, options));

  EXPECT_THROW(LearnedSimulator("there is no such file"), InputError);
  nn::Weights other;
  other.metadata["architecture"] = "crom";
  EXPECT_THROW(make(other), InputError);
}

}  // namespace
}  // namespace graupel::graph
