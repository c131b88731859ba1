// Rollouts of networks that predict several frames at once.
#include "graph/plan/layer_plan.h"
#include "tests/graph/cuda/simulator_case.h"

namespace graupel::graph {
namespace {

/// A network that predicts these normalised accelerations of the frames of a bundle, whatever it sees.
nn::Weights constant_weights(HgnConfig config, const std::vector<float>& accelerations) {
  config.bundle = static_cast<int64_t>(accelerations.size()) / 3;
  nn::Weights weights = random_weights(config, free_flight());
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

/// x_n = x_0 + n v_0 + a n (n + 1) / 2, whichever frames are predicted at once.
TEST_F(LearnedSimulatorTest, ConstantAccelerationsMakeParabolas) {
  const Scene scene;
  const Environment environment(scene);
  const auto position = blobs(2, 30, 0.05);
  const auto start =
      start_history(position, std::vector<Vec3f>(30, Vec3f{0.3f, 0.6f, -0.2f}), scene.gravity, frame_time, 4);
  const Vec3d a = {0.0005, 0.001 + gravity * frame_time * frame_time, -0.0002};
  for (const int bundle : {1, 2, 4}) {
    const LearnedSimulator simulator = make(constant_weights(small_config(), repeated({0.5f, 1, -0.2f}, bundle)));
    EXPECT_EQ(simulator.config().bundle, bundle);
    const Trajectory t =
        simulator.rollout(scene, environment, std::vector<int32_t>(30, 5), start, uncorrected(11));  // cuts the last
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

TEST_F(LearnedSimulatorTest, RolloutsGoOnFromTheirOwnFrames) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Environment environment(scene);
  HgnConfig config = small_config();
  config.bundle = 2;
  Normalization small;
  for (float& deviation : small.acceleration_std) deviation = 1e-4f;
  const LearnedSimulator simulator = make(random_weights(config, small));
  auto history = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0.1f, -2, 0}), scene.gravity, frame_time, 4);
  const std::vector<int32_t> type(100, 5);
  LearnedSimulator::RolloutOptions options;
  options.density_limit = 0;  // which keeps pressures from frame to frame
  options.frames = 12;
  const Trajectory whole = simulator.rollout(scene, environment, type, history, options);
  ASSERT_EQ(whole.frame_count(), 13u);
  history.clear();
  for (std::size_t f = 3; f <= 6; ++f) history.push_back(whole.frames[f].position);
  options.frames = 6;
  const Trajectory rest = simulator.rollout(scene, environment, type, history, options);
  for (std::size_t f = 0; f <= 6; ++f) EXPECT_EQ(rest.frames[f].position, whole.frames[6 + f].position) << f;
}

TEST_F(LearnedSimulatorTest, FramesOfABundleHaveTheirAccelerationsInOrder) {
  const LearnedSimulator simulator = make(constant_weights(small_config(), {1, 0, 0, 0, 2, 0, 0, 0, 3}));
  Scene scene;
  const Environment environment(scene);
  const std::vector<Vec3f> position = {{0.5f, 0.5f, 0.5f}};
  const auto start = start_history(position, {Vec3f::zero()}, {0, 0, 0}, frame_time, 4);
  const Trajectory t = simulator.rollout(scene, environment, {5}, start, uncorrected(5));
  ASSERT_EQ(t.frame_count(), 6u);
  Vec3d velocity = Vec3d::zero(), x = position[0].cast<double>();
  for (std::size_t f = 1; f < 6; ++f) {
    const int axis = static_cast<int>((f - 1) % 3);
    velocity[1] += gravity * frame_time * frame_time;
    velocity[axis] += 0.001 * (axis + 1);
    x += velocity;
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(t.frames[f].position[0][d], x[d], 1e-6) << "frame " << f;
  }
  EXPECT_NEAR(simulator.one_step(environment, {5}, start)[0][0], 0.001, 1e-8);
}

/// Corrections of a frame change the velocity that the next acceleration is added to: every frame of a bundle is made
/// as a single one.
TEST_F(LearnedSimulatorTest, ABundleIsItsFramesOneByOne) {
  const Scene scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  const Environment environment(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  const auto run = [&](int bundle, bool project) {
    LearnedSimulator::RolloutOptions options;
    options.frames = 23;
    options.density_limit = 0;
    options.project = project;
    return make(constant_weights(small_config(), repeated({0.5f, -1, 0.25f}, bundle)))
        .rollout(scene, environment, std::vector<int32_t>(100, 5), start, options);
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
  const Environment environment(scene);
  const auto start = start_history(sheet(), std::vector<Vec3f>(100, Vec3f{0, -2, 0}), scene.gravity, frame_time, 4);
  const LearnedSimulator simulator = make(constant_weights(small_config(), repeated({0.5f, -1, 0.25f}, 3)));
  const auto frame = [&](int64_t frames, double density_limit) {
    LearnedSimulator::RolloutOptions options;
    options.frames = frames;
    options.density_limit = density_limit;
    return simulator.rollout(scene, environment, std::vector<int32_t>(100, 5), start, options).frames.back().position;
  };
  int64_t changed = 1;  // the first frame that the density changes
  while (changed < 24 && frame(changed, 0.5) == frame(changed, 0)) ++changed;
  ASSERT_LT(changed, 24);
  EXPECT_EQ(changed % 3, 0);
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
  const Environment environment(scene);
  const auto start = start_history(blobs(2, 60, 0.05), std::vector<Vec3f>(60, Vec3f::zero()), {0, 0, 0}, frame_time, 4);
  const std::vector<int32_t> type(60, 6);
  const std::vector<Vec3f> acceleration = one.one_step(environment, type, start);
  EXPECT_EQ(three.one_step(environment, type, start), acceleration);
  EXPECT_EQ(three.rollout(scene, environment, type, start, uncorrected(1)).frames[1].position,
            one.rollout(scene, environment, type, start, uncorrected(1)).frames[1].position);
  EXPECT_NE(three.rollout(scene, environment, type, start, uncorrected(2)).frames[2].position,
            one.rollout(scene, environment, type, start, uncorrected(2)).frames[2].position);
}

TEST_F(LearnedSimulatorTest, TheCostOfABundleIsSpreadOverItsFrames) {
  const LearnedSimulator simulator = make(constant_weights(small_config(), repeated({0, 0, 0}, 4)));
  const Scene scene;
  const Environment environment(scene);
  const auto position = blobs(2, 300, 0.05);
  const auto start = start_history(position, std::vector<Vec3f>(300, Vec3f::zero()), scene.gravity, frame_time, 4);
  auto options = uncorrected(6);
  std::vector<FrameTiming> timing;
  options.progress = [&](int64_t, const FrameTiming& t) { timing.push_back(t); };
  simulator.rollout(scene, environment, std::vector<int32_t>(300, 5), start, options);
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
  const auto grid = sparsegrid::build_hierarchy<3>(position, bundled.spacing, environment.wall_low, 2);
  EXPECT_DOUBLE_EQ(simulator.flop(environment, position), flop_of(plan_of(bundled), rows_of(grid)) / 4);
}

}  // namespace
}  // namespace graupel::graph
