#include "graph/learned_simulator.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "core/device.h"
#include "core/error.h"
#include "graph/network_flop.h"
#include "random_input.h"

namespace graupel::graph {
namespace {

constexpr double gravity = -9.8, frame_time = 1.0 / 60;

HgnConfig small_config() {
  HgnConfig config;
  config.latent = 16;
  config.levels = 2;
  config.message_passing = 2;
  config.embedding = 4;
  config.history = 3;
  return config;
}

/// Mean acceleration = gravity, so that a network whose output is 0 predicts free flight.
Normalization free_flight() {
  Normalization n;
  n.acceleration_mean[1] = static_cast<float>(gravity * frame_time * frame_time);
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_std[axis] = 0.01f;
    n.acceleration_std[axis] = 0.001f;
  }
  return n;
}

class LearnedSimulatorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("graupel_simulator_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "net.safetensors").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  LearnedSimulator make(nn::Weights weights) const {
    nn::write_safetensors(path_, weights);
    return LearnedSimulator(path_);
  }
  LearnedSimulator make_ballistic() const {
    nn::Weights weights = random_weights(small_config(), free_flight());
    silence_decoder(weights);
    return make(weights);
  }

  std::filesystem::path folder_;
  std::string path_;
};

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
  const Surroundings surroundings{Scene{}};
  const auto history =
      start_history(blobs(2, 30, 0.05), std::vector<Vec3f>(30, Vec3f::zero()), {0, 0, 0}, frame_time, 4);
  FrameTiming timing;
  const auto acceleration = simulator.one_step(surroundings, std::vector<int32_t>(30, 5), history, &timing);
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

TEST_F(LearnedSimulatorTest, ZeroOutputIsBallisticFlight) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  scene.source = "{}";
  scene.seed = 7;
  const Surroundings surroundings(scene);
  const auto position = blobs(3, 50, 0.05);
  const std::vector<Vec3f> velocity(50, Vec3f{0.3f, 1.0f, -0.2f});
  const auto start = start_history(position, velocity, scene.gravity, scene.frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 12;
  std::vector<int64_t> seen;
  options.progress = [&](int64_t frame, const FrameTiming&) { seen.push_back(frame); };
  const Trajectory t = simulator.rollout(scene, surroundings, std::vector<int32_t>(50, 6), start, options);
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
  const Surroundings surroundings(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 40;
  const Trajectory t = simulator.rollout(scene, surroundings, std::vector<int32_t>(100, 5), start, options);
  EXPECT_EQ(t.diverged_at_frame, -1);
  for (const ParticleFrame& frame : t.frames)
    for (const Vec3f& x : frame.position) {
      ASSERT_GT(surroundings.obstacles.sample(x.cast<double>()).phi, -1e-6);
      ASSERT_GE(x[1], static_cast<float>(surroundings.hold_low[1]));
    }
  options.project = false;
  const Trajectory free = simulator.rollout(scene, surroundings, std::vector<int32_t>(100, 5), start, options);
  EXPECT_LT(free.frames.back().position[0][1], 0);
}

TEST_F(LearnedSimulatorTest, RolloutsHoldTheDensityLimit) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  scene.gravity = {0, gravity, 0};
  const Surroundings surroundings(scene);
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
    const Trajectory t = simulator.rollout(scene, surroundings, type, start, options);
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
  const Surroundings surroundings(scene);
  const auto position = blobs(1, 20, 0.02);
  const auto start = start_history(position, std::vector<Vec3f>(20, Vec3f::zero()), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 30;
  options.project = false;
  options.free_flight = false;
  const Trajectory t = simulator.rollout(scene, surroundings, std::vector<int32_t>(20, 5), start, options);
  EXPECT_EQ(t.diverged_at_frame, 4);  // 0.3, 0.6, 0.9, 1.2 m a frame in a domain of 1 m
  EXPECT_EQ(t.frame_count(), 4u);
  for (const Vec3f& x : t.frames.back().position) EXPECT_TRUE(std::isfinite(x[0]));
}

/// A network that predicts these normalised accelerations of the frames of a bundle, whatever it sees.
nn::Weights constant_weights(HgnConfig config, const std::vector<float>& accelerations) {
  config.bundle = static_cast<int64_t>(accelerations.size()) / 3;
  Normalization normalization = free_flight();
  if (config.is_ballistic()) normalization.acceleration_mean[1] = 0;  // of the corrections
  nn::Weights weights = random_weights(config, normalization);
  silence_decoder(weights);
  weights.tensors["decoder.layer2.bias"] =
      nn::Tensor::from_float(accelerations, {static_cast<int64_t>(accelerations.size())});
  return weights;
}

std::vector<float> repeated(const std::vector<float>& values, int times) {
  std::vector<float> all;
  all.reserve(values.size() * static_cast<std::size_t>(times));
  for (int i = 0; i < times; ++i) all.insert(all.end(), values.begin(), values.end());
  return all;
}

LearnedSimulator::RolloutOptions uncorrected(int64_t frames) {
  LearnedSimulator::RolloutOptions options;
  options.frames = frames;
  options.project = options.free_flight = false;
  options.density_limit = 0;
  return options;
}

/// x_n = x_0 + n v_0 + a n (n + 1) / 2, whichever frames are predicted at once, and whether gravity is the network's.
TEST_F(LearnedSimulatorTest, ConstantAccelerationsMakeParabolas) {
  const Scene scene;
  const Surroundings surroundings(scene);
  const auto position = blobs(2, 30, 0.05);
  const auto start =
      start_history(position, std::vector<Vec3f>(30, Vec3f{0.3f, 0.6f, -0.2f}), scene.gravity, frame_time, 4);
  const Vec3d a = {0.0005, 0.001 + gravity * frame_time * frame_time, -0.0002};
  for (const auto& [bundle, predictor] : {std::pair(1, FramePredictor::none),
                                          {2, FramePredictor::none},
                                          {4, FramePredictor::none},
                                          {1, FramePredictor::ballistic},
                                          {4, FramePredictor::ballistic}}) {
    HgnConfig config = small_config();
    config.predictor = predictor;
    const LearnedSimulator simulator = make(constant_weights(config, repeated({0.5f, 1, -0.2f}, bundle)));
    EXPECT_EQ(simulator.config().bundle, bundle);
    EXPECT_EQ(simulator.config().predictor, config.predictor);
    const Trajectory t =
        simulator.rollout(scene, surroundings, std::vector<int32_t>(30, 5), start, uncorrected(11));  // cuts the last
    ASSERT_EQ(t.frame_count(), 12u);
    for (std::size_t f = 0; f < t.frame_count(); ++f)
      for (std::size_t i = 0; i < 30; ++i)
        for (int d = 0; d < 3; ++d) {
          const auto n = static_cast<double>(f);
          const double velocity = static_cast<double>(start[3][i][d]) - static_cast<double>(start[2][i][d]);
          EXPECT_NEAR(t.frames[f].position[i][d], position[i][d] + n * velocity + a[d] * n * (n + 1) / 2, 2e-6)
              << "bundle " << bundle << ", frame " << f;
        }
  }
}

/// The ballistic predictor is a change of what goes into the network and of what its output is added to.
TEST_F(LearnedSimulatorTest, AfterAPredictionTheNetworkSeesTheBallisticFrame) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Surroundings surroundings(scene);
  const auto history =
      start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0.1f, -2, 0}), scene.gravity, frame_time, 4);
  const std::vector<int32_t> type(100, 5);
  std::vector<std::vector<Vec3f>> seen(history.begin() + 1, history.end());
  const Vec3f g = (scene.gravity * (frame_time * frame_time)).cast<float>();
  seen.push_back(seen.back());
  for (std::size_t i = 0; i < 100; ++i) seen[3][i] = history[3][i] + (history[3][i] - history[2][i]) + g;
  HgnConfig config = small_config();
  const auto expected = make(random_weights(config, Normalization{})).one_step(surroundings, type, seen);
  config.predictor = FramePredictor::ballistic;
  const LearnedSimulator simulator = make(random_weights(config, Normalization{}));
  const auto actual = simulator.one_step(surroundings, type, history);
  for (std::size_t i = 0; i < 100; ++i)
    for (int d = 0; d < 3; ++d)
      EXPECT_NEAR(actual[i][d], expected[i][d] + g[d], 1e-6f * (1 + std::abs(expected[i][d])));
}

TEST_F(LearnedSimulatorTest, RolloutsOfCorrectedFramesGoOnFromTheirOwn) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Surroundings surroundings(scene);
  HgnConfig config = small_config();
  config.predictor = FramePredictor::ballistic;
  config.bundle = 2;
  Normalization small;
  for (float& deviation : small.acceleration_std) deviation = 1e-4f;
  const LearnedSimulator simulator = make(random_weights(config, small));
  auto history = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0.1f, -2, 0}), scene.gravity, frame_time, 4);
  const std::vector<int32_t> type(100, 5);
  LearnedSimulator::RolloutOptions options;
  options.density_limit = 0;  // which keeps pressures from frame to frame
  options.frames = 12;
  const Trajectory whole = simulator.rollout(scene, surroundings, type, history, options);
  ASSERT_EQ(whole.frame_count(), 13u);
  history.clear();
  for (std::size_t f = 3; f <= 6; ++f) history.push_back(whole.frames[f].position);
  options.frames = 6;
  const Trajectory rest = simulator.rollout(scene, surroundings, type, history, options);
  for (std::size_t f = 0; f <= 6; ++f) EXPECT_EQ(rest.frames[f].position, whole.frames[6 + f].position) << f;
}

TEST_F(LearnedSimulatorTest, FramesOfABundleHaveTheirAccelerationsInOrder) {
  const LearnedSimulator simulator = make(constant_weights(small_config(), {1, 0, 0, 0, 2, 0, 0, 0, 3}));
  Scene scene;
  const Surroundings surroundings(scene);
  const std::vector<Vec3f> position = {{0.5f, 0.5f, 0.5f}};
  const auto start = start_history(position, {Vec3f::zero()}, {0, 0, 0}, frame_time, 4);
  const Trajectory t = simulator.rollout(scene, surroundings, {5}, start, uncorrected(5));
  ASSERT_EQ(t.frame_count(), 6u);
  Vec3d velocity = Vec3d::zero(), x = position[0].cast<double>();
  for (std::size_t f = 1; f < 6; ++f) {
    const int axis = static_cast<int>((f - 1) % 3);
    velocity[1] += gravity * frame_time * frame_time;
    velocity[axis] += 0.001 * (axis + 1);
    x += velocity;
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(t.frames[f].position[0][d], x[d], 1e-6) << "frame " << f;
  }
  EXPECT_NEAR(simulator.one_step(surroundings, {5}, start)[0][0], 0.001, 1e-8);
}

/// Corrections of a frame change the velocity that the next acceleration is added to: every frame of a bundle is made
/// as a single one.
TEST_F(LearnedSimulatorTest, ABundleIsItsFramesOneByOne) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Surroundings surroundings(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  const auto run = [&](int bundle, bool project) {
    LearnedSimulator::RolloutOptions options;
    options.frames = 23;
    options.density_limit = 0;
    options.project = project;
    return make(constant_weights(small_config(), repeated({0.5f, -1, 0.25f}, bundle)))
        .rollout(scene, surroundings, std::vector<int32_t>(100, 5), start, options);
  };
  const Trajectory one = run(1, true), loose = run(1, false);
  ASSERT_NE(loose.frames[23].position, one.frames[23].position) << "nothing was corrected";
  for (const int bundle : {3, 8}) {
    const Trajectory bundled = run(bundle, true);
    for (std::size_t f = 0; f <= 23; ++f) ASSERT_EQ(bundled.frames[f].position, one.frames[f].position);
  }
}

TEST_F(LearnedSimulatorTest, TheDensityIsHeldAfterTheLastFrameOfABundle) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Surroundings surroundings(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  const LearnedSimulator simulator = make(constant_weights(small_config(), repeated({0.5f, -1, 0.25f}, 3)));
  const auto frame = [&](int64_t frames, double density_limit) {
    LearnedSimulator::RolloutOptions options;
    options.frames = frames;
    options.density_limit = density_limit;
    return simulator.rollout(scene, surroundings, std::vector<int32_t>(100, 5), start, options).frames.back().position;
  };
  int64_t held = 1;  // the first frame that the density changes
  while (held < 24 && frame(held, 0.5) == frame(held, 0)) ++held;
  ASSERT_LT(held, 24);
  EXPECT_EQ(held % 3, 0);
}

TEST_F(LearnedSimulatorTest, TheFirstFrameOfABundleIsOneStep) {
  HgnConfig config = small_config();
  config.bundle = 3;
  nn::Weights bundled = random_weights(config, free_flight());
  const LearnedSimulator three = make(bundled);
  nn::Weights first = bundled;
  first.metadata = small_config().to_metadata();
  for (const char* name : {"decoder.layer2.weight", "decoder.layer2.bias"}) {
    nn::Tensor& tensor = first.tensors.at(name);
    std::vector<float> values = tensor.as_float();
    tensor.shape[0] = 3;
    values.resize(values.size() / 3);
    tensor = nn::Tensor::from_float(values, tensor.shape);
  }
  const LearnedSimulator one = make(first);
  const Scene scene;
  const Surroundings surroundings(scene);
  const auto start = start_history(blobs(2, 60, 0.05), std::vector<Vec3f>(60, Vec3f::zero()), {0, 0, 0}, frame_time, 4);
  const std::vector<int32_t> type(60, 6);
  const std::vector<Vec3f> acceleration = one.one_step(surroundings, type, start);
  EXPECT_EQ(three.one_step(surroundings, type, start), acceleration);
  EXPECT_EQ(three.rollout(scene, surroundings, type, start, uncorrected(1)).frames[1].position,
            one.rollout(scene, surroundings, type, start, uncorrected(1)).frames[1].position);
  EXPECT_NE(three.rollout(scene, surroundings, type, start, uncorrected(2)).frames[2].position,
            one.rollout(scene, surroundings, type, start, uncorrected(2)).frames[2].position);
}

TEST_F(LearnedSimulatorTest, TheCostOfABundleIsSpreadOverItsFrames) {
  const LearnedSimulator simulator = make(constant_weights(small_config(), repeated({0, 0, 0}, 4)));
  const Scene scene;
  const Surroundings surroundings(scene);
  const auto position = blobs(2, 300, 0.05);
  const auto start = start_history(position, std::vector<Vec3f>(300, Vec3f::zero()), scene.gravity, frame_time, 4);
  auto options = uncorrected(6);
  std::vector<FrameTiming> timing;
  options.progress = [&](int64_t, const FrameTiming& t) { timing.push_back(t); };
  simulator.rollout(scene, surroundings, std::vector<int32_t>(300, 5), start, options);
  ASSERT_EQ(timing.size(), 6u);
  for (const std::size_t f : {1u, 2u, 3u}) {
    EXPECT_EQ(timing[f].network, timing[0].network);
    EXPECT_EQ(timing[f].features, timing[0].features);
    EXPECT_EQ(timing[f].hierarchy, timing[0].hierarchy);
  }
  EXPECT_NE(timing[4].network, timing[0].network);
  EXPECT_EQ(timing[5].network, timing[4].network);
  EXPECT_GT(timing[5].network, 0);
  HgnConfig bundled = small_config();
  bundled.bundle = 4;
  const auto grid = sparsegrid::build_hierarchy<3>(position, bundled.spacing, surroundings.wall_low, 2);
  EXPECT_DOUBLE_EQ(simulator.flop(surroundings, position), flop_of(bundled, rows_of(grid)) / 4);
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
  const Surroundings surroundings(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 30;
  FrameTiming timing;
  options.progress = [&](int64_t, const FrameTiming& t) { timing = t; };
  const Trajectory t = ballistic.rollout(scene, surroundings, std::vector<int32_t>(100, 5), start, options);
  EXPECT_EQ(t.frame_count(), 31u);
  EXPECT_EQ(t.particle_count(), 100u);
  EXPECT_NEAR(t.frames[1].position[0][1], 0.7 - 2 * frame_time + gravity * frame_time * frame_time / 2, 1e-5);
  for (const Vec3f& x : t.frames.back().position) {
    EXPECT_GT(surroundings.obstacles.sample(x.cast<double>()).phi, -1e-6);
  }
  EXPECT_GT(timing.network, 0);
  EXPECT_GT(timing.features, 0);
  EXPECT_GT(timing.hierarchy, 0);
  std::vector<Trajectory> runs;
  options.frames = 4;
  for (const int threads : {1, 3}) {
    set_num_threads(threads);
    runs.push_back(random.rollout(scene, surroundings, std::vector<int32_t>(100, 6), start, options));
  }
  set_num_threads(0);
  EXPECT_EQ(runs[0].frames.back().position, runs[1].frames.back().position);
  options.device = Device::cuda;
  try {
    random.rollout(scene, surroundings, std::vector<int32_t>(100, 6), start, options);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("Use --device cpu"), std::string::npos) << error.what();
  }
}

TEST_F(LearnedSimulatorTest, RolloutsDoNotDependOnTheNumberOfThreads) {
  const LearnedSimulator simulator = make(random_weights(small_config(), free_flight()));
  const Scene scene;
  const Surroundings surroundings(scene);
  const auto start =
      start_history(blobs(3, 400, 0.06), std::vector<Vec3f>(400, Vec3f::zero()), scene.gravity, frame_time, 4);
  LearnedSimulator::RolloutOptions options;
  options.frames = 5;
  std::vector<Trajectory> runs;
  for (const int threads : {1, 2, 5}) {
    set_num_threads(threads);
    runs.push_back(simulator.rollout(scene, surroundings, std::vector<int32_t>(400, 8), start, options));
  }
  set_num_threads(0);
  EXPECT_EQ(runs[0].frames.back().position, runs[1].frames.back().position);
  EXPECT_EQ(runs[0].frames.back().position, runs[2].frames.back().position);
}

TEST_F(LearnedSimulatorTest, UnfitScenesStartsAndFilesAreErrors) {
  const LearnedSimulator simulator = make_ballistic();
  Scene scene;
  const Surroundings surroundings(scene);
  const std::vector<Vec3f> position(3, Vec3f::filled(0.5f));
  const auto start = start_history(position, position, scene.gravity, frame_time, 4);
  const std::vector<int32_t> type(3, 5);
  LearnedSimulator::RolloutOptions options;
  options.frames = 1;
  EXPECT_NO_THROW(simulator.rollout(scene, surroundings, type, start, options));
  EXPECT_THROW(simulator.rollout(scene, surroundings, type, {start.begin() + 1, start.end()}, options), InputError);
  EXPECT_THROW(simulator.rollout(scene, surroundings, {5, 5}, start, options), InputError);
  auto broken = start;
  broken[1][2][0] = std::nanf("");
  EXPECT_THROW(simulator.rollout(scene, surroundings, type, broken, options), InputError);
  Scene slow = scene;
  slow.frame_time = 0.1;
  EXPECT_THROW(simulator.rollout(slow, surroundings, type, start, options), ConfigError);

  Scene fine;
  fine.domain.dx = 1.0 / 32;
  Obstacle box;
  box.position = {0.5, 0.2, 0.5};
  fine.obstacles.push_back(box);
  EXPECT_THROW(simulator.rollout(fine, Surroundings(fine), type, start, options), ConfigError);
  EXPECT_NO_THROW(simulator.rollout(fine, Surroundings(fine, simulator.config().dx), type, start, options));

  EXPECT_THROW(LearnedSimulator("there is no such file"), InputError);
  nn::Weights other;
  other.metadata["architecture"] = "crom";
  EXPECT_THROW(make(other), InputError);
}

}  // namespace
}  // namespace graupel::graph
