// Data set, statistics, training noise, and that batches do not depend on the workers.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "core/system/error.h"
#include "tests/train/tiny_data.h"
#include "train/data/data_set.h"
#include "train/data/sampling.h"
#include "train/data/symmetry.h"
#include "train/parallel/worker_threads.h"

namespace graupel::train {
namespace {

TEST(DataSplit, HoldsWhatWasWritten) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  ASSERT_EQ(split.count(), 4);
  const Trajectory truth = tiny_trajectory(2, 24, 30);
  EXPECT_EQ(split.trajectory(1).frames, 30);
  EXPECT_EQ(split.trajectory(1).initial_velocity, truth.frames[0].velocity);
  const auto frames = split.positions(1, 7, 2);
  EXPECT_EQ(frames[0], truth.frames[7].position);
  EXPECT_EQ(frames[1], truth.frames[8].position);
  // Equal scenes share their environment.
  EXPECT_EQ(split.trajectory(0).context, split.trajectory(3).context);
}

TEST(DataSplit, ReadsOnDemandWhatDoesNotFit) {
  DataSplitOptions small;
  small.memory_limit = 1;
  const DataSplit on_demand(tiny_data_set() + "/train.h5", small), resident(tiny_data_set() + "/train.h5");
  EXPECT_EQ(on_demand.positions(2, 3, 5), resident.positions(2, 3, 5));
}

TEST(DataSplit, HistoryBeforeTheStartIsBallistic) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const auto history = split.history(0, 1, 4);
  ASSERT_EQ(history.size(), 5u);
  EXPECT_EQ(history[4], split.positions(0, 1, 1).front());
  EXPECT_EQ(history[3], split.positions(0, 0, 1).front());
  // The tiny trajectories start in free flight: second differences are gravity's all along.
  const Vec3f gravity = split.trajectory(0).context->gravity_step();
  for (std::size_t t = 1; t + 1 < history.size(); ++t)
    for (std::size_t p = 0; p < history[0].size(); ++p)
      for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(history[t + 1][p][d] - 2 * history[t][p][d] + history[t - 1][p][d], gravity[d], 3e-7f);
}

TEST(DataSplit, RefusesDataOfAnotherFrameTimeOrMissingFiles) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  graph::HgnConfig config = tiny_config().hgn;
  EXPECT_NO_THROW(split.check_fits(config));
  config.frame_time = 0.01;
  EXPECT_THROW(split.check_fits(config), ConfigError);
  config = tiny_config().hgn;
  config.dx = 0.01;
  EXPECT_THROW(split.check_fits(config), ConfigError);
  EXPECT_THROW(DataSplit(tiny_data_set() + "/none.h5"), InputError);
}

TEST(DataSplit, ScenesWithPeriodicWallsAreNotTrainedOn) {
  Scene scene;
  EXPECT_NO_THROW(SceneContext{scene});
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  EXPECT_THROW(SceneContext{scene}, ConfigError);
}

TEST(Statistics, AreThoseOfAllFrameDifferencesWithTheNoiseInQuadrature) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  std::vector<double> velocity, acceleration;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Trajectory t = tiny_trajectory(seed, 24, 30);
    for (std::size_t f = 1; f < 30; ++f)
      for (std::size_t p = 0; p < 24; ++p) {
        const auto y = [&](std::size_t frame) { return static_cast<double>(t.frames[frame].position[p][1]); };
        velocity.push_back(y(f) - y(f - 1));
        if (f + 1 < 30) acceleration.push_back(y(f + 1) - 2 * y(f) + y(f - 1));
      }
  }
  const auto moments = [](const std::vector<double>& values) {
    double mean = 0, variance = 0;
    for (const double v : values) mean += v / static_cast<double>(values.size());
    for (const double v : values) variance += (v - mean) * (v - mean) / static_cast<double>(values.size());
    return std::pair(mean, variance);
  };
  constexpr double noise = 2e-3;
  const graph::Normalization n = split.statistics(noise, 2);
  const auto [vm, vv] = moments(velocity);
  const auto [am, av] = moments(acceleration);
  EXPECT_NEAR(n.velocity_mean[1], vm, 1e-6 * std::abs(vm) + 1e-9);
  EXPECT_NEAR(n.velocity_std[1], std::sqrt(vv + noise * noise), 1e-5 * std::sqrt(vv));
  EXPECT_NEAR(n.acceleration_mean[1], am, 1e-4 * std::abs(am));
  EXPECT_NEAR(n.acceleration_std[1], std::sqrt(av + noise * noise), 1e-5 * std::sqrt(av));
}

TEST(Noise, IsARandomWalkWhoseLastVelocityHasTheGivenDeviation) {
  constexpr int m = 5, n = 20000;
  constexpr double noise_std = 1e-3;
  std::vector<std::vector<Vec3f>> positions(m + 1, std::vector<Vec3f>(n, Vec3f::zero()));
  const auto newest = add_random_walk(positions, noise_std, Random(1, RandomPurpose::training_noise, 5));
  EXPECT_EQ(positions[0], std::vector<Vec3f>(n, Vec3f::zero()));
  EXPECT_EQ(positions[m], newest);
  for (int j = 1; j <= m; ++j) {
    double sum2 = 0, sum = 0;
    for (std::size_t p = 0; p < n; ++p)
      for (int d = 0; d < 3; ++d) {
        const double v =
            positions[static_cast<std::size_t>(j)][p][d] - positions[static_cast<std::size_t>(j) - 1][p][d];
        sum += v;
        sum2 += v * v;
      }
    const double expected = noise_std * std::sqrt(static_cast<double>(j) / m);
    EXPECT_NEAR(std::sqrt(sum2 / (3 * n)), expected, 0.02 * expected) << "velocity " << j;
    EXPECT_NEAR(sum / (3 * n), 0, 4 * expected / std::sqrt(3.0 * n));
  }
}

TEST(Noise, TargetUndoesTheNoiseOfTheNewestVelocity) {
  // With the noise added to the next position too, the target is the true acceleration minus the velocity's noise.
  const DataSplit split(tiny_data_set() + "/train.h5");
  const auto clean = split.history(0, 10, 2);
  auto noisy = clean;
  auto next = split.positions(0, 11, 1).front();
  const auto truth = acceleration_of(next, clean);
  const auto newest = add_random_walk(noisy, 1e-3, Random(1, RandomPurpose::training_noise));
  for (std::size_t p = 0; p < next.size(); ++p) next[p] += newest[p];
  const auto target = acceleration_of(next, noisy);
  for (std::size_t p = 0; p < next.size(); ++p)
    for (int d = 0; d < 3; ++d) {
      const float velocity_noise = (noisy[2][p][d] - noisy[1][p][d]) - (clean[2][p][d] - clean[1][p][d]);
      EXPECT_NEAR(target[p][d], truth[p][d] - velocity_noise, 3e-7f);
    }
}

TEST(Sampling, DrawsEveryTrajectoryAndFrame) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  std::set<std::pair<int, int64_t>> seen;
  for (int64_t step = 0; step < 400; ++step)
    for (int64_t slot = 0; slot < 4; ++slot) {
      const SampleKey key = draw_sample(split, 1, step, slot);
      ASSERT_LT(key.frame, 29);
      seen.insert({key.trajectory, key.frame});
    }
  EXPECT_EQ(seen.size(), 4u * 29u);  // 1600 draws of 116
}

TEST(Sampling, TargetsOfABundleAreTheDifferencesOfTheData) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  TrainConfig config = tiny_config();
  config.noise_std = 0;
  config.hgn.bundle = 4;
  const Batch batch = training_batch(split, config, {}, 3), noisy = [&] {
    TrainConfig with_noise = config;
    with_noise.noise_std = 1e-3;
    return training_batch(split, with_noise, {}, 3);
  }();
  ASSERT_EQ(batch.target_width, 12);
  const float* target = batch.numbers.data() + batch.target.begin;
  const float* of_noisy = noisy.numbers.data() + noisy.target.begin;
  for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
    const SampleKey key = draw_training_sample(split, config, 3, slot).key;
    EXPECT_LE(key.frame + 4, 29) << "the last frame";
    const Trajectory truth = tiny_trajectory(static_cast<uint64_t>(key.trajectory) + 1, 24, 30);
    const auto past = split.history(key.trajectory, key.frame, 1);  // before the first frame too
    const auto y = [&](int64_t frame, std::size_t p, int d) {
      return static_cast<double>(frame < key.frame ? past[0][p][d]
                                                   : truth.frames[static_cast<std::size_t>(frame)].position[p][d]);
    };
    for (std::size_t p = 0; p < 24; ++p, target += 12, of_noisy += 12)
      for (int64_t j = 1; j <= 4; ++j)
        for (int d = 0; d < 3; ++d) {
          const int64_t at = 3 * (j - 1) + d, f = key.frame + j;
          EXPECT_NEAR(target[at], y(f, p, d) - 2 * y(f - 1, p, d) + y(f - 2, p, d), 2e-7);
          if (j == 1)
            EXPECT_NE(of_noisy[at], target[at]) << "takes back the velocity's noise";
          else
            EXPECT_EQ(of_noisy[at], target[at]) << "from the true velocity on";
        }
  }
}

TEST(Sampling, FramesOfABundleFollowItsSamplesAndPushes) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  TrainConfig config = tiny_config();
  config.hgn.bundle = 4;
  config.push_steps = 3;
  config.push_share = 1;
  int64_t last = 0;
  for (int64_t step = 0; step < 200; ++step)
    for (int64_t slot = 0; slot < 4; ++slot)
      last = std::max(last, draw_training_sample(split, config, step, slot).key.frame + 4 * pushes_of(config, step));
  EXPECT_EQ(last, 29 - 4);
  EXPECT_NO_THROW(split.check_samples(29, 0));
  try {
    split.check_samples(10, 2);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("30 usable frames, needed 31 for bundle 10 and push_steps 2"),
              std::string::npos)
        << error.what();
  }
}

TEST(Sampling, JitterMovesTheGridWithinTheChosenCell) {
  TrainConfig config = tiny_config();
  EXPECT_DOUBLE_EQ(config.jitter_width(), 0.14);  // 0.07 * 2^(2-1)
  config.jitter = GridJitter::finest;
  EXPECT_DOUBLE_EQ(config.jitter_width(), 0.07);
  config.jitter = GridJitter::none;
  EXPECT_EQ(config.jitter_width(), 0);
}

TEST(Sampling, BatchesDoNotDependOnTheWorkers) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const TrainConfig config = tiny_config();
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  const auto batches = [&](int workers, int64_t first) {
    OrderedQueue<Batch> queue(workers, first, 8, 3,
                              [&](int64_t k) { return training_batch(split, config, normalization, k); });
    std::vector<Batch> all;
    for (int64_t k = first; k < 8; ++k) all.push_back(queue.next());
    return all;
  };
  const auto one = batches(1, 0), three = batches(3, 0), resumed = batches(2, 5);
  for (std::size_t k = 0; k < 8; ++k) {
    EXPECT_EQ(one[k].numbers, three[k].numbers);
    EXPECT_EQ(one[k].indices, three[k].indices);
    if (k >= 5) {
      EXPECT_EQ(one[k].numbers, resumed[k - 5].numbers);
    }
  }
  EXPECT_NE(one[0].numbers, one[1].numbers);
}

TEST(Waves, AreInTheHistoryAndTheTargetTakesThemBack) {
  TrainConfig config = tiny_config();
  config.noise_std = 0;
  const DataSplit split(tiny_data_set() + "/train.h5");
  const SampleRules rules = [&] {
    SampleRules made = sample_rules(config, {});  // not normalised
    made.wave_recovery = 0.25f;
    return made;
  }();
  const auto environment = split.trajectory(0).context->environment.view(Device::cpu);
  SampleScene scene{0, 0, {}, {}, {}, environment};
  const auto sample = [&](std::vector<float>& features, std::vector<float>& target) {
    Vec3f position[3] = {{0.5f, 0.5f, 0.5f}, {0.501f, 0.5f, 0.49f}, {0.502f, 0.499f, 0.48f}};
    features.resize(static_cast<std::size_t>(rules.features.width));
    target.resize(3);
    const auto truth = [](int) { return Vec3f{0.503f, 0.498f, 0.47f}; };  // of the next frame
    return write_disturbed_sample(rules, scene, 0, false, graph::no_material, position, truth, features.data(),
                                  target.data());
  };
  std::vector<float> still, target_still, moved, target_moved;
  const Vec3f x = sample(still, target_still);
  scene.displacement.vector[0] = {30, 40, 0};
  scene.displacement.amplitude[0] = 0.004f;
  scene.drift.vector[1] = {0, 0, 60};
  scene.drift.phase[1] = 1;
  scene.drift.amplitude[1] = 0.001f;
  const Vec3f displacement = scene.displacement.at({0.502f, 0.499f, 0.48f}), drift = scene.drift.at({0, 0, 0.48f});
  EXPECT_NEAR(norm(displacement), 0.004 * std::abs(std::cos(30 * 0.502 + 40 * 0.499)), 1e-6);
  EXPECT_NEAR(displacement[0] * 4, displacement[1] * 3, 1e-7) << "along its vector";
  const Vec3f y = sample(moved, target_moved);
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(y[d] - x[d], displacement[d], 1e-7);
    const auto at = static_cast<std::size_t>(d);
    EXPECT_NEAR(moved[at] - still[at], drift[d], 2e-7) << "the newest velocity";
    EXPECT_NEAR(moved[3 + at] - still[3 + at], drift[d], 2e-7) << "the one before";
    EXPECT_NEAR(target_moved[at] - target_still[at], -0.25f * displacement[d] - drift[d], 3e-7);
  }
}

TEST(Waves, AreDrawnForTheirShareOfTheSamplesWithinTheirStrain) {
  TrainConfig config = tiny_config();
  const DataSplit split(tiny_data_set() + "/train.h5");
  EXPECT_EQ(draw_training_sample(split, config, 3, 1).displacement.amplitude[0], 0);
  config.wave_share = 0.5;
  config.wave_strain = 0.3;
  int with = 0;
  for (int64_t step = 0; step < 200; ++step) {
    const SampleDraw draw = draw_training_sample(split, config, step, 0);
    float strain = 0;
    for (int i = 0; i < Waves::count; ++i) {
      strain += draw.displacement.amplitude[i] * norm(draw.displacement.vector[i]);
      if (draw.displacement.amplitude[i] == 0) continue;
      const double length = 2 * std::numbers::pi / static_cast<double>(norm(draw.displacement.vector[i]));
      EXPECT_GE(length, 0.999 * config.wave_shortest);
      EXPECT_LE(length, 1.001 * config.wave_longest);
    }
    EXPECT_LE(strain, 0.3001f);
    with += strain > 0;
  }
  EXPECT_NEAR(with, 100, 30);
}

TEST(Symmetry, LeavesGravityAloneAndKeepsLengths) {
  const Vec3d gravity = {0, -9.8, 0};
  const auto all = symmetries_of(gravity);
  EXPECT_EQ(all.size(), 8u);
  EXPECT_EQ(symmetries_of(Vec3d::zero()).size(), 48u);
  std::set<std::vector<double>> images;
  for (const AxisMap& symmetry : all) {
    const Vec3d image = symmetry.apply(Vec3d{1, 2, 3});
    EXPECT_EQ(image[1], 2);
    EXPECT_DOUBLE_EQ(norm2(image), 14);
    images.insert({image[0], image[1], image[2]});
  }
  EXPECT_EQ(images.size(), 8u);
  std::set<int> drawn;
  for (uint64_t k = 0; k < 200; ++k) {
    const AxisMap symmetry = draw_symmetry(gravity, 3, Random(1, RandomPurpose::training_symmetry, k));
    drawn.insert(9 * symmetry.axis[0] + 3 * symmetry.sign[0] + symmetry.sign[2]);
  }
  EXPECT_EQ(drawn.size(), 8u);
}

TEST(Symmetry, TurnedFeaturesAreThoseOfTheTurnedScene) {
  // The tiny scene's sphere lies off centre; each turned scene is built anew, sphere and domain moved with it.
  const std::string text = tiny_scene();
  const Scene scene = io::parse_scene(text, "tiny", ".");
  const graph::Environment environment(scene);
  graph::HgnConfig config = tiny_config().hgn;
  graph::Normalization normalization;
  for (int d = 0; d < 3; ++d) {
    normalization.velocity_mean[d] = 0.001f * static_cast<float>(d);
    normalization.velocity_std[d] = 0.01f + 0.002f * static_cast<float>(d);
  }
  std::vector<std::vector<Vec3f>> history(3);
  const Random random(3, RandomPurpose::test);
  for (uint64_t p = 0; p < 40; ++p)
    for (std::size_t t = 0; t < 3; ++t) {
      Vec3f x;
      for (int d = 0; d < 3; ++d)
        x[d] = static_cast<float>(random.uniform(p, d, 0.05, 0.45) + 0.004 * random.uniform(40 + 3 * p + t, d));
      history[t].push_back(x);
    }
  for (const AxisMap& symmetry : symmetries_of(scene.gravity)) {
    Scene turned = scene;
    Vec3d low = scene.domain.origin, high = scene.domain.origin + scene.domain.size;
    apply_to_box(symmetry, low, high);
    turned.domain.origin = low;
    turned.obstacles[0].position = symmetry.apply(scene.obstacles[0].position);
    auto turned_history = history;
    for (auto& frame : turned_history)
      for (Vec3f& x : frame) x = symmetry.apply(x);
    const auto expected = graph::particle_features(config, normalization, graph::Environment(turned), turned_history);
    const auto features = graph::particle_features(config, normalization, environment, history, {}, symmetry);
    ASSERT_EQ(features.size(), expected.size());
    const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (i % width >= 6 && i % width < 9) continue;  // the turned scene draws the grid of the cell normals anew
      EXPECT_NEAR(features[i], expected[i], 2e-3) << "particle " << i / width << " feature " << i % width;
    }
  }
}

TEST(Symmetry, BatchesWithSymmetriesHoldTurnedTargets) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  TrainConfig config = tiny_config();
  const graph::Normalization identity;
  const Batch plain = training_batch(split, config, identity, 0);
  config.symmetries = true;
  const Batch turned = training_batch(split, config, identity, 0);
  ASSERT_EQ(plain.target.count, turned.target.count);
  bool moved = false;
  for (int64_t i = 0; i < plain.target.count; i += 3) {
    const float* a = plain.numbers.data() + plain.target.begin + i;
    const float* b = turned.numbers.data() + turned.target.begin + i;
    EXPECT_EQ(a[1], b[1]);
    EXPECT_FLOAT_EQ(a[0] * a[0] + a[2] * a[2], b[0] * b[0] + b[2] * b[2]);
    moved = moved || a[0] != b[0];
  }
  EXPECT_TRUE(moved);
}

TEST(OrderedQueue, HandsOnAWorkersError) {
  OrderedQueue<int> queue(2, 0, 4, 2, [](int64_t k) -> int {
    if (k == 1) throw InputError("bad frame");
    return static_cast<int>(k);
  });
  EXPECT_EQ(queue.next(), 0);
  EXPECT_THROW(queue.next(), InputError);
  EXPECT_EQ(queue.next(), 2);
}

TEST(TrainConfig, RateFallsAsThePapersScaledToTheRun) {
  TrainConfig config;
  config.steps = 4000;
  EXPECT_NEAR(config.rate_at(0), 1e-4, 1e-12);
  EXPECT_NEAR(config.rate_at(1000), 1e-6 + 0.99e-4 * 0.1, 1e-12);
  EXPECT_NEAR(config.rate_at(4000), 1e-6 + 0.99e-4 * 1e-4, 1e-12);
  config.decay_steps = 500;
  EXPECT_NEAR(config.rate_at(1000), 1e-6 + 0.99e-4 * 0.01, 1e-12);
  config.schedule = RateSchedule::cosine;
  config.warm_up_steps = 10;
  EXPECT_NEAR(config.rate_at(0), 1e-5, 1e-8);
  EXPECT_NEAR(config.rate_at(2000), 1e-6 + 0.99e-4 * 0.5, 1e-12);
  EXPECT_NEAR(config.rate_at(4000), 1e-6, 1e-12);
  EXPECT_EQ(config.rate_at(1000, 0.5), config.rate_at(2000)) << "by the clock";
  EXPECT_EQ(config.rate_at(3000, 0.5), config.rate_at(3000)) << "by the steps";
  EXPECT_NEAR(config.rate_at(0, 0.5), 0.1 * config.rate_at(2000), 1e-12) << "warm-up is of steps";
}

}  // namespace
}  // namespace graupel::train
