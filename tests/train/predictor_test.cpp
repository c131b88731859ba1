// Networks that correct ballistic frames: what they see, what they are to predict, and what is made of that.
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "graph/learned_simulator.h"
#include "graph/normalization.h"
#include "tests/train/tiny_data.h"
#include "train/evaluation.h"
#include "train/network_module.h"
#include "train/sampling.h"

namespace graupel::train {
namespace {

using graph::FramePredictor;

TrainConfig ballistic_config() {
  TrainConfig config = tiny_config();
  config.hgn.predictor = FramePredictor::ballistic;
  config.symmetries = true;
  config.noise_std = 0;
  return config;
}

/// Row p of scene `slot` of a batch whose scenes have 24 particles.
const float* row_of(const Batch& batch, const Part& part, int64_t width, int64_t slot, std::size_t p) {
  return batch.numbers.data() + part.begin + width * (24 * slot + static_cast<int64_t>(p));
}

TEST(Predictor, TargetsLeadFromTheBallisticFramesToTheData) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  TrainConfig config = ballistic_config();
  config.hgn.bundle = 3;
  const graph::Normalization n = split.statistics(0, 1, FramePredictor::ballistic);
  const Vec3f gravity = split.trajectory(0).context->gravity_step();
  for (int64_t step = 0; step < 5; ++step) {
    const Batch batch = training_batch(split, config, n, step);
    for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
      const SampleDraw draw = draw_training_sample(split, config, step, slot);
      const auto past = split.history(draw.key.trajectory, draw.key.frame, 1);
      const auto truth = split.positions(draw.key.trajectory, draw.key.frame + 1, 3);
      for (std::size_t p = 0; p < 24; ++p) {
        Vec3f before = past[0][p], x = past[1][p];
        for (std::size_t j = 0; j < 3; ++j) {
          const float* target = row_of(batch, batch.target, 9, slot, p) + 3 * j;
          const Vec3f next = x + (x - before) + gravity + draw.turn.undo(graph::real_acceleration(n, false, target));
          for (int d = 0; d < 3; ++d) ASSERT_NEAR(next[d], truth[j][p][d], 3e-7f);
          before = x;
          x = truth[j][p];
        }
      }
    }
  }
}

TEST(Predictor, InFreeFlightTheNetworkSeesTheNextFrameAndHasNothingToCorrect) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const TrainConfig config = ballistic_config();
  const int64_t width = config.hgn.input_width() - config.hgn.embedding;
  std::size_t flying = 0;
  for (int64_t step = 0; step < 5; ++step) {
    const Batch batch = training_batch(split, config, {}, step);
    for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
      const SampleDraw draw = draw_training_sample(split, config, step, slot);
      const auto now = split.positions(draw.key.trajectory, draw.key.frame, 2);
      for (std::size_t p = 0; p < 24; ++p) {
        if (now[0][p][1] < 0.22f || now[1][p][1] < 0.22f) continue;  // of the soft floor
        ++flying;
        const float* feature = row_of(batch, batch.features, width, slot, p);
        const Vec3f velocity = draw.turn.apply(now[1][p] - now[0][p]);
        for (int d = 0; d < 3; ++d) {
          EXPECT_NEAR(feature[d], velocity[d], 3e-7);
          EXPECT_NEAR(row_of(batch, batch.target, 3, slot, p)[d], 0, 5e-7);
        }
        const float to_floor = feature[3 * config.hgn.history + 3 + 1];  // distances follow the normal
        EXPECT_NEAR(to_floor, std::min(1.0, now[1][p][1] / config.hgn.wall_clamp), 1e-5);
      }
    }
  }
  EXPECT_GT(flying, 100u);
}

TEST(Predictor, StatisticsAreThoseOfTheCorrections) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization all = split.statistics(1e-3, 1),
                             less = split.statistics(1e-3, 1, FramePredictor::ballistic);
  const Vec3f gravity = split.trajectory(0).context->gravity_step();
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(less.acceleration_mean[d], all.acceleration_mean[d] - gravity[d], 1e-9);
    EXPECT_NEAR(less.acceleration_std[d], all.acceleration_std[d], 1e-6 * all.acceleration_std[d]);
    EXPECT_EQ(less.velocity_mean[d], all.velocity_mean[d]);
    EXPECT_EQ(less.velocity_std[d], all.velocity_std[d]);
  }
}

/// A network that corrects nothing.
NetworkModule silent_module(const graph::HgnConfig& config) {
  NetworkModule module(config, Device::cpu, 1);
  nn::Weights weights = module.state(StateArray::weights);
  for (const char* name : {"decoder.layer2.weight", "decoder.layer2.bias"}) {
    nn::Tensor& tensor = weights.tensors.at(name);
    std::fill(tensor.bytes.begin(), tensor.bytes.end(), std::byte{0});
  }
  for (const StateArray array : {StateArray::weights, StateArray::ema}) module.set_state(array, weights);
  return module;
}

TEST(Predictor, ErrorsAreOfTheTrueAccelerationAndRolloutsAddGravity) {
  const DataSplit split(tiny_data_set() + "/test.h5");
  const NetworkModule module = silent_module(ballistic_config().hgn);
  const auto samples = strided_samples(split, 1);
  const SquaredErrors errors = evaluate_one_step(module, {}, split, samples, {}).all();
  EXPECT_GT(errors.raw_mse(Predictor::network), 0);
  EXPECT_NEAR(errors.raw_mse(Predictor::network), errors.raw_mse(Predictor::ballistic),
              1e-6 * errors.raw_mse(Predictor::ballistic));
  EXPECT_LT(evaluate_rollout(module, {}, split, 1, 5, {}), 1e-12) << "all of it is free flight";
  TrainConfig bundled = ballistic_config();
  bundled.hgn.bundle = 4;
  EXPECT_LT(evaluate_rollout(silent_module(bundled.hgn), {}, split, 1, 5, {}), 1e-12);
}

/// The rollouts that training validates on are those of the inference engine.
template <typename Config>
void expect_the_rollout_of_the_engine(const Config& config) {
  const std::string file = test_folder("engine") + "/net.safetensors";
  const DataSplit split(tiny_data_set() + "/test.h5");
  const graph::Normalization normalization = split.statistics(0, 1, config.predictor);
  const NetworkModule module(NetworkConfig(config), Device::cpu, 5);
  nn::Weights weights = module.state(StateArray::weights);
  weights.metadata = config.to_metadata();
  graph::add_normalization(weights, normalization);
  nn::write_safetensors(file, weights);
  const graph::LearnedSimulator simulator(file);
  const TrajectoryInfo& scene = split.trajectory(0);
  graph::LearnedSimulator::RolloutOptions options;
  options.frames = 29;
  options.free_flight = false;
  options.density_limit = 0;
  const Trajectory t =
      simulator.rollout(scene.context->scene, scene.context->surroundings, tiny_trajectory(201, 24, 1).particle_type,
                        split.history(0, 0, config.history), options);
  const auto truth = split.positions(0, 0, 30);
  double squares = 0;
  for (std::size_t f = 1; f < 30; ++f)
    for (std::size_t p = 0; p < 24; ++p)
      squares += norm2((t.frames[f].position[p] - truth[f][p]).template cast<double>()) / (29 * 24);
  EXPECT_GT(squares, 1e-6) << "it does not fall as the data do";
  EXPECT_NEAR(evaluate_rollout(module, normalization, split, 1, 29, {.which = StateArray::weights}), squares,
              1e-3 * squares);
  remove_path(std::filesystem::path(file).parent_path());
}

TEST(Predictor, RolloutsAreThoseOfTheInferenceEngine) {
  graph::HgnConfig hgn = ballistic_config().hgn;
  hgn.bundle = 2;
  expect_the_rollout_of_the_engine(hgn);
  graph::GnsConfig gns;
  gns.latent = 16;
  gns.embedding = 4;
  gns.message_passing = 2;
  gns.radius = 0.07;
  gns.dx = 0.03125;
  gns.predictor = FramePredictor::ballistic;
  expect_the_rollout_of_the_engine(gns);
  gns.obstacle_particles = true;
  gns.obstacle_spacing = 0.03;
  expect_the_rollout_of_the_engine(gns);
}

TEST(Predictor, DataThatDoNotSayTheirGravityAreRefused) {
  const std::string folder = test_folder("no_gravity");
  const auto split_of = [&](const std::string& name, const std::string& made_by, const char* gravity) {
    Trajectory trajectory = tiny_trajectory(1, 4, 5);
    trajectory.made_by = made_by;
    trajectory.scene_json =
        io::scene_to_json(io::parse_scene(tiny_scene(), "tiny", ".", {std::string("gravity=") + gravity}));
    io::TrajectoryWriter writer(folder + name, trajectory, {.velocity = false});
    for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
    writer.finish();
    return DataSplit(folder + name);
  };
  const graph::HgnConfig config = ballistic_config().hgn;
  const DataSplit unknown = split_of("/unknown.h5", "converted from gns 'x.npz'", "[0,0,0]");
  EXPECT_NO_THROW(unknown.check_fits(tiny_config().hgn));
  try {
    unknown.check_fits(config);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    for (const char* text : {"/unknown.h5'", "trajectory 0", "hgn.predictor", "--set gravity="})
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
  }
  EXPECT_NO_THROW(split_of("/known.h5", "converted from gns 'x.npz'", "[0,-5,0]").check_fits(config));
  EXPECT_NO_THROW(split_of("/weightless.h5", "mpm", "[0,0,0]").check_fits(config));
  remove_path(folder);
}

}  // namespace
}  // namespace graupel::train
