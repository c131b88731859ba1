// Whole training runs on a tiny data set: learning, exact resume, validation, evaluation.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "graph/learned_simulator.h"
#include "graph/networks/graph_network.h"
#include "io/config/json_node.h"
#include "nn/offline_cost.h"
#include "tests/graph/random_weights.h"
#include "tests/train/learning.h"
#include "tests/train/tiny_data.h"
#include "train/loop/checkpoint.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_loop.h"
#include "train/networks/initial_weights.h"

namespace graupel::train {
namespace {

namespace fs = std::filesystem;

TrainingOptions tiny_options(const std::string& run) {
  TrainingOptions options;
  options.data = tiny_data_set();
  options.run = run;
  options.config = tiny_config();
  options.threads = 1;
  options.version = "test";
  return options;
}

std::string array_bytes(const std::string& run, const char* step, const char* array) {
  return read_file(run + "/checkpoints/" + step + "/" + array + ".safetensors");
}

void expect_equal_states(const std::string& a, const std::string& b, const char* step) {
  for (const StateArray array : all_state_arrays)
    EXPECT_TRUE(array_bytes(a, step, name_of(array)) == array_bytes(b, step, name_of(array))) << name_of(array);
}

TEST(Training, TwentyStepsEqualTenAndResumedTen) {
  const std::string folder = test_folder("resume");
  train_network(tiny_options(folder + "/whole"));
  TrainingOptions parts = tiny_options(folder + "/parts");
  parts.stop_step = 10;
  EXPECT_EQ(train_network(parts).reason, StopReason::reached_stop_step);
  parts.stop_step = 0;
  parts.resume = true;
  const TrainingResult result = train_network(parts);
  EXPECT_EQ(result.reason, StopReason::finished);
  EXPECT_EQ(result.step, 20);
  EXPECT_EQ(result.scene_samples, 80);
  expect_equal_states(folder + "/whole", folder + "/parts", "step-00000020");
  // Also from a damaged newest checkpoint, and with every step logged once.
  std::ofstream(folder + "/parts/checkpoints/step-00000020/state.json") << "{";
  std::string said;
  parts.message = [&](const std::string& text) { said += text + "\n"; };
  train_network(parts);
  EXPECT_NE(said.find("WARNING"), std::string::npos);
  EXPECT_NE(said.find("resumed at step 10"), std::string::npos);
  expect_equal_states(folder + "/whole", folder + "/parts", "step-00000020");
  std::ifstream csv(folder + "/parts/metrics.csv");
  std::vector<std::string> losses;  // the second column after the step
  for (std::string line; std::getline(csv, line);)
    if (std::isdigit(line[0]) && line.find(",,") != line.find(',', line.find(',') + 1))
      losses.push_back(line.substr(0, 3));
  EXPECT_EQ(losses, (std::vector<std::string>{"10,", "20,"}));
  remove_path(folder);
}

TEST(Training, RunsFromBeforeASettingGoOn) {
  const std::string folder = test_folder("older");
  TrainingOptions options = tiny_options(folder + "/run");
  options.stop_step = 10;
  train_network(options);
  options.stop_step = 0;
  options.resume = true;
  const std::string file = options.run + "/config.json", last = options.run + "/checkpoints/step-00000010/state.json";
  const std::string current = run_config_hash(options.run), settings = read_file(file);
  EXPECT_EQ(current, config_hash(options.config));
  io::JsonNode older = io::parse_json(settings, file);
  EXPECT_EQ(std::erase_if(older.find("hgn")->members,
                          [](const auto& m) { return m.key == "dimensions" || m.key == "bundle"; }),
            2u);
  write_file_atomically(file, io::write_json(older, io::JsonLayout::indented));
  EXPECT_THROW(train_network(options), ConfigError);  // the checkpoint is of all settings
  std::string state = read_file(last);
  state.replace(state.find(current), current.size(), run_config_hash(options.run));
  write_file_atomically(last, state);
  EXPECT_EQ(train_network(options).reason, StopReason::finished);
  TrainingOptions other = options;
  other.config.noise_std *= 2;
  EXPECT_THROW(train_network(other), ConfigError);
  remove_path(folder);
}

TEST(Training, RefusesOptionsThatWereRemoved) {
  const auto read = [](const std::string& hgn) { return read_train_config("{\"hgn\": {" + hgn + "}}", "c.json"); };
  EXPECT_EQ(train_config_text(read(R"("predictor": "none", "short_range": 0.0)")), train_config_text(TrainConfig()));
  for (const std::string setting : {R"("predictor": "ballistic")", R"("short_range": 0.5)"}) try {
      read(setting);
      ADD_FAILURE() << setting;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find("this setting was removed"), std::string::npos) << error.what();
    }
}

TEST(Training, RunsWithTheNetworksOwnFramesResumeTheSame) {
  const std::string folder = test_folder("pushes");
  TrainingOptions whole = tiny_options(folder + "/whole"), parts = tiny_options(folder + "/parts");
  for (TrainingOptions* options : {&whole, &parts}) {
    options->config.push_steps = 3;
    options->config.wave_share = 0.5;
  }
  train_network(whole);
  parts.stop_step = 10;
  train_network(parts);
  parts.stop_step = 0;
  parts.resume = true;
  EXPECT_EQ(train_network(parts).reason, StopReason::finished);
  expect_equal_states(folder + "/whole", folder + "/parts", "step-00000020");
  remove_path(folder);
}

TEST(Training, EndsWithItsScheduleByTheClock) {
  const std::string folder = test_folder("clock");
  TrainingOptions options = tiny_options(folder);
  options.config.steps = 1000000;
  options.config.schedule_minutes = 0.01;
  const TrainingResult result = train_network(options);
  EXPECT_EQ(result.reason, StopReason::finished);
  EXPECT_GT(result.step, 0);
  EXPECT_LT(result.step, options.config.steps);
  EXPECT_GE(result.seconds, 0.6);
  options.resume = true;
  // Its time is over, but for what the last step's checkpoint took to be written.
  EXPECT_LE(train_network(options).step, result.step + 10);
  remove_path(folder);
}

TEST(Training, ABundleOfFramesIsTrainedResumedAndRolledOut) {
  const std::string folder = test_folder("bundle");
  TrainingOptions whole = tiny_options(folder + "/whole"), parts = tiny_options(folder + "/parts");
  for (TrainingOptions* options : {&whole, &parts}) {
    options->config.hgn.bundle = 3;
    options->config.push_steps = 2;
    options->config.wave_share = 0.5;
  }
  const TrainingResult result = train_network(whole);
  ASSERT_TRUE(result.validation);
  EXPECT_TRUE(std::isfinite(result.validation->rollout_mse));  // of five frames: the second bundle is cut
  parts.stop_step = 10;
  train_network(parts);
  parts.stop_step = 0;
  parts.resume = true;
  EXPECT_EQ(train_network(parts).reason, StopReason::finished);
  expect_equal_states(folder + "/whole", folder + "/parts", "step-00000020");
  const graph::LearnedSimulator simulator(result.weights_file);
  EXPECT_EQ(simulator.config().bundle, 3);
  const DataSplit split(tiny_data_set() + "/test.h5");
  const TrajectoryInfo& scene = split.trajectory(0);
  const Trajectory t = simulator.rollout(scene.context->scene, scene.context->environment, std::vector<int32_t>(24, 5),
                                         split.history(0, 4, 2), {.frames = 7, .progress = {}});
  EXPECT_EQ(t.frame_count(), 8u);
  parts = tiny_options(folder + "/long");
  parts.config.hgn.bundle = 8;
  parts.config.push_steps = 3;
  EXPECT_THROW(train_network(parts), ConfigError);  // 33 frames of 30
  remove_path(folder);
}

TEST(Training, LearnsABundleOfFrames) {
  const std::string folder = test_folder("learn_bundle");
  TrainingOptions options = tiny_options(folder + "/run");
  LossCourse loss;
  learn_fast(options, 400, loss);
  options.config.hgn.bundle = 2;
  options.config.rollout_frames = 9;
  const TrainingResult result = train_network(options);
  EXPECT_LT(loss.last, loss.first / 3);
  const SquaredErrors errors = result.validation->one_step.all();
  EXPECT_LT(errors.raw_mse(Predictor::network), 0.6 * errors.raw_mse(Predictor::zero));
  EXPECT_LT(result.validation->rollout_mse, 1e-3);
  remove_path(folder);
}

TEST(Training, ANetworkOfOneFrameStartsABundle) {
  const std::string folder = test_folder("start_bundle");
  const auto of_frames = [](int64_t bundle) {
    graph::GnsConfig config;
    config.bundle = bundle;
    config.hidden_layers = 2;
    return NetworkConfig(config);
  };
  const std::string one = folder + "/one.safetensors";
  nn::Weights weights = graph::random_weights(std::get<graph::GnsConfig>(of_frames(1)), graph::Normalization{}, 7);
  nn::write_safetensors(one, weights);
  const std::vector<float> frame = weights.get("decoder.layer3.weight", {3, 128});
  const nn::Weights three = starting_weights(one, of_frames(3));
  const std::vector<float> rows = three.get("decoder.layer3.weight", {9, 128});
  for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_EQ(rows[k], frame[k % frame.size()]);
  EXPECT_EQ(three.get("decoder.layer3.bias", {9})[7], weights.get("decoder.layer3.bias", {3})[1]);
  EXPECT_EQ(three.get("decoder.layer1.bias", {128}), weights.get("decoder.layer1.bias", {128}));
  // Other settings stay an error.
  auto other = std::get<graph::GnsConfig>(of_frames(3));
  other.message_passing = 4;
  EXPECT_THROW(starting_weights(one, NetworkConfig(other)), ConfigError);
  remove_path(folder);
}

TEST(Training, ABundleStartsFromWeightsOfOneFrame) {
  const std::string folder = test_folder("from_one");
  TrainingOptions one = tiny_options(folder + "/one"), two = tiny_options(folder + "/two");
  one.config.steps = two.config.steps = 2;
  two.config.hgn.bundle = 2;
  two.config.learning_rate = two.config.final_learning_rate = 1e-12;
  two.from = train_network(one).weights_file;
  const nn::Weights started = nn::read_safetensors(two.from);
  const nn::Weights trained = nn::read_safetensors(train_network(two).weights_file);
  const int64_t h = two.config.hgn.latent;
  const std::vector<float> frame = started.get("decoder.layer2.weight", {3, h});
  const std::vector<float> rows = trained.get("decoder.layer2.weight", {6, h});
  for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_NEAR(rows[k], frame[k % frame.size()], 1e-6);
  remove_path(folder);
}

TEST(Training, LearnsToBounce) {
  const std::string folder = test_folder("learn");
  TrainingOptions options = tiny_options(folder + "/run");
  LossCourse loss;
  learn_fast(options, 400, loss);
  options.config.checkpoint_interval = 200;
  options.config.validation_interval = 200;
  options.config.validation_samples = 40;
  options.progress = [&](const TrainingProgress& p) {
    loss.add(p.loss);
    EXPECT_LT(p.scenes_per_second, 1e6);  // time spent on validation and checkpoints is taken off once
  };
  const TrainingResult result = train_network(options);
  EXPECT_LT(loss.last, loss.first / 3);
  ASSERT_TRUE(result.validation);
  const SquaredErrors errors = result.validation->one_step.all();
  EXPECT_LT(errors.raw_mse(Predictor::network), 0.5 * errors.raw_mse(Predictor::zero));
  EXPECT_LT(errors.raw_mse(Predictor::network), 0.5 * errors.raw_mse(Predictor::ballistic));
  EXPECT_TRUE(std::isfinite(result.validation->rollout_mse));
  EXPECT_LT(result.validation->rollout_mse, 1e-3);
  // The exported weights are complete for the inference engine.
  const graph::GraphNetwork engine(nn::read_safetensors(result.weights_file));
  EXPECT_EQ(std::get<graph::HgnConfig>(engine.config()).latent, 16);
  EXPECT_EQ(nn::read_safetensors(result.weights_file).metadata.at("training.scene_samples"), "1600");
  remove_path(folder);
}

TEST(Training, StopsCleanlyWhenAskedAndWhenTimeIsOver) {
  const std::string folder = test_folder("stop");
  TrainingOptions options = tiny_options(folder + "/asked");
  int asked = 0;
  options.should_stop = [&] { return ++asked == 7; };
  TrainingResult result = train_network(options);
  EXPECT_EQ(result.reason, StopReason::stopped);
  EXPECT_EQ(result.step, 7);
  EXPECT_TRUE(fs::exists(folder + "/asked/checkpoints/step-00000007/state.json"));
  options = tiny_options(folder + "/time");
  options.minutes = 1e-9;
  result = train_network(options);
  EXPECT_EQ(result.reason, StopReason::out_of_time);
  EXPECT_EQ(result.step, 1);
  EXPECT_TRUE(fs::exists(folder + "/time/weights.safetensors"));
  remove_path(folder);
}

TEST(Training, AValidationEndsWhereARunIsStopped) {
  const std::string folder = test_folder("cut");
  TrainingOptions options = tiny_options(folder + "/run");
  options.config.validation_interval = 1;
  options.should_stop = [] { return true; };
  const TrainingResult result = train_network(options);
  EXPECT_EQ(result.reason, StopReason::stopped);
  EXPECT_EQ(result.step, 1);
  EXPECT_FALSE(result.validation);
  EXPECT_TRUE(fs::exists(folder + "/run/checkpoints/step-00000001/state.json"));
  remove_path(folder);
}

TEST(Training, DivergenceIsReported) {
  const std::string folder = test_folder("diverge");
  TrainingOptions options = tiny_options(folder + "/run");
  options.config.learning_rate = 1e18;
  options.config.clip_norm = 0;
  EXPECT_THROW(train_network(options), DivergedError);
  // Also where no step is reported before the next checkpoint: that holds no weights that are none.
  options = tiny_options(folder + "/quiet");
  options.config.learning_rate = 1e18;
  options.config.clip_norm = 0;
  options.config.log_interval = 1000;
  options.config.checkpoint_interval = 10;
  EXPECT_THROW(train_network(options), DivergedError);
  EXPECT_TRUE(fs::is_empty(checkpoint_folder(folder + "/quiet")));
  options.run = folder + "/short";
  options.stop_step = 9;
  EXPECT_THROW(train_network(options), DivergedError);
  EXPECT_FALSE(fs::exists(folder + "/short/weights.safetensors"));
  remove_path(folder);
}

TEST(Training, StartsFromItsWeightsAgainWhereItWasKilledBeforeItsFirstCheckpoint) {
  const std::string folder = test_folder("from");
  TrainingOptions options = tiny_options(folder + "/first");
  options.config.steps = 5;
  const std::string weights = train_network(options).weights_file;
  options = tiny_options(folder + "/whole");
  options.from = weights;
  train_network(options);
  for (const bool before_normalization : {false, true}) {
    const std::string run = folder + (before_normalization ? "/earlier" : "/killed");
    options = tiny_options(run);
    options.from = weights;
    options.stop_step = 2;
    train_network(options);
    remove_path(checkpoint_folder(run));
    fs::create_directory(checkpoint_folder(run));
    if (before_normalization) fs::remove(run + "/normalization.safetensors");
    options = tiny_options(run);
    options.resume = true;
    train_network(options);
    expect_equal_states(folder + "/whole", run, "step-00000020");
  }
  fs::remove(folder + "/killed/normalization.safetensors");
  options.run = folder + "/killed";
  EXPECT_THROW(train_network(options), InputError);  // of its checkpoints
  fs::remove_all(checkpoint_folder(options.run));
  fs::create_directory(checkpoint_folder(options.run));
  fs::copy_file(folder + "/whole/weights.safetensors", weights, fs::copy_options::overwrite_existing);
  EXPECT_THROW(train_network(options), ConfigError);  // other weights
  remove_path(folder);
}

/// The data of tiny_data_set() in a folder whose card tells what they took.
std::string data_that_took(const std::string& folder, const std::string& made_in) {
  fs::create_directories(folder);
  for (const char* name : {"train.h5", "valid.h5", "test.h5"})
    fs::copy_file(tiny_data_set() + "/" + name, folder + "/" + name);
  write_file_atomically(folder + "/dataset.json", R"({"recipe": {"name": "tiny"}, "seed": 1)" + made_in + "}");
  return folder;
}

TEST(Training, WeightsTellTheCostOfTheirDataAndOfAllTraining) {
  const std::string folder = test_folder("cost");
  const auto cost_of = [](const TrainingResult& result) {
    return nn::offline_cost_of(nn::read_safetensors(result.weights_file).metadata, result.weights_file);
  };
  TrainingOptions options = tiny_options(folder + "/first");
  options.config.steps = 4;
  options.data = data_that_took(folder + "/data", R"(, "made_in": [{"device": "a GPU", "seconds": 30}])");
  const nn::OfflineCost first = cost_of(train_network(options));
  EXPECT_EQ(nn::total_seconds(first.data), 30);
  EXPECT_EQ(first.data[0].device, "a GPU");
  ASSERT_EQ(first.training.size(), 1u);
  EXPECT_GT(first.training[0].seconds, 0);
  EXPECT_EQ(first.training[0].device, hardware_name(Device::cpu, 1));

  // A run from these weights has their cost too, also when it is resumed; the same data are paid once.
  options.run = folder + "/second";
  options.from = folder + "/first/weights.safetensors";
  options.stop_step = 2;
  train_network(options);
  options.from.clear();
  options.stop_step = 0;
  options.resume = true;
  const nn::OfflineCost second = cost_of(train_network(options));
  EXPECT_EQ(nn::total_seconds(second.data), 30);
  ASSERT_EQ(second.training.size(), 2u);
  EXPECT_NEAR(*second.training[0].seconds, *first.training[0].seconds, 1e-9);

  // What is not told stays unknown: a card of before, and weights of before.
  TrainingOptions untold = tiny_options(folder + "/third");
  untold.config.steps = 2;
  untold.data = data_that_took(folder + "/old", "");
  EXPECT_FALSE(nn::total_seconds(cost_of(train_network(untold)).data));
  nn::Weights older = nn::read_safetensors(folder + "/first/weights.safetensors");
  older.metadata.erase(nn::offline_cost_key);
  nn::write_safetensors(folder + "/older.safetensors", older);
  untold.run = folder + "/fourth";
  untold.from = folder + "/older.safetensors";
  EXPECT_FALSE(nn::total_seconds(cost_of(train_network(untold)).training));
  remove_path(folder);
}

TEST(Training, RefusesAnUsedFolderAndChangedSettings) {
  const std::string folder = test_folder("refuse");
  TrainingOptions options = tiny_options(folder + "/run");
  options.from = folder + "/none.safetensors";
  EXPECT_THROW(train_network(options), InputError);
  EXPECT_FALSE(fs::exists(options.run));  // the same --out is free for what is meant
  options.from.clear();
  {
    const FileLock another = lock_run(options.run);
    EXPECT_THROW(train_network(options), ConfigError);
  }
  options.config.steps = 2;
  train_network(options);
  EXPECT_THROW(train_network(options), ConfigError);
  options.resume = true;
  const std::string usual = options.data;
  options.data = folder + "/data";
  fs::create_directory(options.data);
  fs::copy_file(usual + "/valid.h5", options.data + "/train.h5");
  std::string said;
  options.message = [&](const std::string& text) { said += text + "\n"; };
  train_network(options);
  EXPECT_NE(said.find("is not the data that the run began with"), std::string::npos) << said;
  options.data = usual;
  options.message = {};
  options.config.learning_rate = 1e-5;
  EXPECT_THROW(train_network(options), ConfigError);
  fs::create_directory(folder + "/later");
  write_file_atomically(folder + "/later/config.json", R"({"field": "factored"})");  // of a reduced model
  EXPECT_EQ(fs::path(latest_run(folder, Architecture::hgn)).filename(), "run");
  EXPECT_THROW(latest_run(folder, Architecture::gns), InputError);
  EXPECT_EQ(read_run_facts(folder + "/run").data, fs::path(tiny_data_set()).lexically_normal());
  EXPECT_THROW(latest_run(folder + "/none", Architecture::hgn), InputError);
  fs::create_directory(checkpoint_folder(folder + "/run") + "/step-99999999999999999999");  // no step
  EXPECT_NO_THROW(read_latest_checkpoint(checkpoint_folder(folder + "/run"), {}));
  write_file_atomically(folder + "/run/run.json", R"({"data": 5})");
  EXPECT_THROW(read_run_facts(folder + "/run"), InputError);
  EXPECT_THROW(read_run_config(folder), InputError);
  remove_path(folder);
}

TEST(Evaluation, BaselinesAndRegionsOfKnownMotion) {
  const DataSplit split(tiny_data_set() + "/test.h5");
  const graph::Normalization normalization = split.statistics(0, 1);
  const NetworkModule module(tiny_config().hgn, Device::cpu, 1);
  const OneStepErrors errors =
      evaluate_one_step(module, normalization, split, strided_samples(split, 1), {.batch_scenes = 4, .threads = 2});
  EXPECT_EQ(errors.samples, 29);
  EXPECT_EQ(errors.all().particles, 29 * 24);
  const auto& airborne = errors.region[static_cast<std::size_t>(Region::airborne)];
  const auto& near = errors.region[static_cast<std::size_t>(Region::near_obstacle)];
  // In flight the ballistic guess is right and no acceleration is wrong by g dt^2.
  const double g2 = std::pow(9.8 / 3600, 2);
  EXPECT_GT(airborne.particles, 300);
  EXPECT_LT(airborne.raw_mse(Predictor::ballistic), 1e-4 * g2);
  EXPECT_NEAR(airborne.raw_mse(Predictor::zero), g2, 0.01 * g2);
  // Bounces happen within 2 dx of the wall
  EXPECT_GT(near.particles, 10);
  EXPECT_GT(near.raw_mse(Predictor::ballistic), 10 * g2);
  // (or just above it, for a particle that arrives within the frame).
  EXPECT_LT(errors.region[static_cast<std::size_t>(Region::bulk)].particles, near.particles / 2);
}

}  // namespace
}  // namespace graupel::train
