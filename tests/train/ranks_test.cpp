// What several ranks compute together is what one process computes; a rank that is gone is noticed.
#include <ATen/core/Tensor.h>
#include <ATen/ops/full.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>

#include "tests/train/rank_threads.h"
#include "tests/train/tiny_data.h"
#include "train/data/sampling.h"
#include "train/loop/checkpoint.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_loop.h"
#include "train/networks/network_module.h"
#include "train/networks/teacher.h"

namespace graupel::train {
namespace {

using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

void expect_all_well(const std::vector<std::exception_ptr>& errors) {
  for (const std::exception_ptr& error : errors) EXPECT_EQ(message_of(error), "");
}

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Largest difference of two weights files relative to the largest number of each tensor.
double difference(const nn::Weights& a, const nn::Weights& b) {
  double largest = 0;
  for (const auto& [name, tensor] : a.tensors) {
    const std::vector<float> x = a.get(name, tensor.shape), y = b.get(name, tensor.shape);
    double scale = 1e-30, gap = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      scale = std::max(scale, std::abs(static_cast<double>(x[i])));
      gap = std::max(gap, std::abs(static_cast<double>(x[i]) - static_cast<double>(y[i])));
    }
    largest = std::max(largest, gap / scale);
  }
  return largest;
}

/// Tests of ranks on the CPU; a libtorch without Gloo's headers cannot connect them.
class Ranks : public testing::Test {
 protected:
  void SetUp() override {
    if (!can_join_ranks(Device::cpu)) GTEST_SKIP() << "this build has no Gloo";
  }
};

TEST(OneRank, ItsCallsKeepTheirArguments) {
  Comm& comm = single_process();
  EXPECT_TRUE(comm.alone());
  EXPECT_TRUE(comm.leads());
  EXPECT_EQ(sum_over_ranks(comm, {1.5, -2}), (std::vector<double>{1.5, -2}));
  EXPECT_EQ(broadcast_text(comm, "text"), "text");
  comm.barrier();
}

TEST_F(Ranks, SumsAndBroadcastsReachEveryRank) {
  expect_all_well(run_ranks(3, [](Comm& comm) {
    const int r = comm.rank();
    EXPECT_EQ(comm.size(), 3);
    EXPECT_EQ(sum_over_ranks(comm, {1.0 * r, 0.5}), (std::vector<double>{3, 1.5}));
    EXPECT_EQ(broadcast_text(comm, r == 0 ? "from rank 0" : "another, longer text"), "from rank 0");
    EXPECT_EQ(broadcast_text(comm, r == 0 ? "" : "x"), "");
    int64_t number = 7 + r;
    broadcast_value(comm, number);
    EXPECT_EQ(number, 7);
    at::Tensor tensor = at::full({5}, static_cast<double>(r + 1), at::kFloat);
    comm.all_reduce_sum(tensor);
    EXPECT_EQ(tensor.sum().item().toDouble(), 30);
    comm.barrier();
  }));
}

// As torchrun, which listens itself and starts ranks anew: here the store of another group on the same port.
TEST_F(Ranks, MeetAtAStoreThatTheLauncherKeeps) {
  const int port = free_port();
  const auto launcher = join_ranks(local_rank(0, 1, port), {Device::cpu, 60, {}});
  for (const int restart : {1, 2}) {
    std::vector<double> sums(2);
    std::vector<std::thread> threads;
    for (int rank = 0; rank < 2; ++rank)
      threads.emplace_back([&, rank] {
        RankEnvironment environment = local_rank(rank, 2, port);
        environment.served = true;
        environment.restart = restart;
        const auto comm = join_ranks(environment, {Device::cpu, 60, {}});
        sums[static_cast<std::size_t>(rank)] = sum_over_ranks(*comm, {rank + 1.0}).front();
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(sums, (std::vector<double>{3, 3}));
  }
}

TEST_F(Ranks, ARankThatLeavesIsNoticedAtOnce) {
  const auto start = Clock::now();
  const auto errors = run_ranks(2, [](Comm& comm) {
    sum_over_ranks(comm, {1});
    if (comm.rank() == 0) sum_over_ranks(comm, {1});
  });
  EXPECT_THAT(message_of(errors[0]), HasSubstr("rank 0 of 2: another rank has ended"));
  EXPECT_LT(seconds_since(start), 20);
}

TEST_F(Ranks, ARankThatIsSilentIsGivenUpAfterTheTimeout) {
  const auto start = Clock::now();
  std::atomic<bool> given_up = false;
  const auto errors = run_ranks(
      2,
      [&](Comm& comm) {
        if (comm.rank() == 1)
          while (!given_up) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        try {
          sum_over_ranks(comm, {1});
        } catch (const CommError&) {
          given_up = true;
          throw;
        }
      },
      3);
  EXPECT_THAT(message_of(errors[0]), HasSubstr("does not answer"));
  EXPECT_LT(seconds_since(start), 20);
}

TEST_F(Ranks, ARankThatNeverComesIsAnError) {
  try {
    join_ranks(local_rank(0, 2, free_port()), {Device::cpu, 1, {}});
    FAIL();
  } catch (const CommError& error) {
    EXPECT_THAT(error.what(), HasSubstr("did not meet at 127.0.0.1:"));
    EXPECT_THAT(error.what(), HasSubstr("rank 1 is missing"));
  }
}

TEST_F(Ranks, RanksOfDifferentDevicesDoNotWaitForEachOther) {
  const int port = free_port();
  const auto refusal = [port](int rank, Device device) -> std::string {
    try {
      join_ranks(local_rank(rank, 2, port), {device, 30, {}});
    } catch (const CommError& error) {
      return error.what();
    }
    return "joined";
  };
  std::thread first(
      [&] { EXPECT_THAT(refusal(0, Device::cpu), HasSubstr("rank 0 of 2 would use Gloo on device cpu")); });
  EXPECT_THAT(refusal(1, Device::cuda), HasSubstr("rank 0 Gloo on device cpu"));
  first.join();
}

TEST_F(Ranks, SharesOfABatchAreTheWholeBatch) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const TrainConfig config = tiny_config();
  const graph::Normalization normalization = split.statistics(0, 1);
  const Batch whole = training_batch(split, config, normalization, 5);
  const Batch second = training_batch(split, config, normalization, 5, {1, 3});
  EXPECT_EQ(second.scenes(), 1);
  EXPECT_EQ(training_batch(split, config, normalization, 5, {0, 3}).scenes(), 2);
  // Scene 1 of the batch, whoever prepares it.
  const auto begin = whole.numbers.begin() + whole.target.begin + 3 * whole.particle_begin[1];
  EXPECT_TRUE(std::equal(begin, begin + 3 * second.particles(), second.numbers.begin() + second.target.begin));
}

/// Weights after a few steps on `ranks` ranks.
nn::Weights trained(int ranks, StepMeans& means) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const TrainConfig config = tiny_config();
  const graph::Normalization normalization = split.statistics(0, 1);
  nn::Weights weights;
  const auto train = [&](Comm& comm) {
    // Other seeds elsewhere: the weights are rank 0's.
    NetworkModule module(config.hgn, Device::cpu, 3 + static_cast<uint64_t>(comm.rank()), NumberType::f64);
    module.share_state(comm);
    for (int64_t step = 0; step < 4; ++step)
      module.train_step(training_batch(split, config, normalization, step, {comm.rank(), comm.size()}),
                        {.learning_rate = 1e-3, .clip_norm = 0.5, .ema_decay = 0.9, .step = step + 1}, comm);
    const StepMeans own = module.take_means();
    const nn::Weights state = module.state(StateArray::weights);
    if (comm.leads()) {
      means = own;
      weights = state;
    }
  };
  if (ranks == 1)
    train(single_process());
  else
    expect_all_well(run_ranks(ranks, train));
  return weights;
}

// Four scenes of 24 particles: on three ranks their shares have 48, 24 and 24 particles, which plain averages of
// gradients would get wrong.
TEST_F(Ranks, StepsOnTwoAndThreeRanksEqualThoseOfOneProcess) {
  StepMeans one, several;
  const nn::Weights expected = trained(1, one);
  for (const int ranks : {2, 3}) {
    EXPECT_LT(difference(expected, trained(ranks, several)), 1e-6) << ranks;  // the weights are read in f32
    EXPECT_NEAR(several.loss, one.loss, 1e-6 * one.loss);
    EXPECT_NEAR(several.gradient_norm, one.gradient_norm, 1e-6 * one.gradient_norm);
  }
}

TrainingOptions options_of(const std::string& run) {
  TrainingOptions options;
  options.data = tiny_data_set();
  options.run = run;
  options.config = tiny_config();
  options.config.checkpoint_interval = 1000;
  options.version = "test";
  return options;
}

/// A run on several ranks; what rank 0 returned.
TrainingResult train_on(int ranks, TrainingOptions options, std::vector<std::exception_ptr>* errors = nullptr) {
  TrainingResult result;
  const auto thrown = run_ranks(ranks, [&](Comm& comm) {
    TrainingOptions own = options;
    own.comm = &comm;
    own.local_ranks = comm.size();
    const TrainingResult returned = train_network(own);
    if (comm.leads()) result = returned;
  });
  if (errors)
    *errors = thrown;
  else
    expect_all_well(thrown);
  return result;
}

nn::Weights state_of(const std::string& run, const char* step, const char* array = "weights") {
  return read_checkpoint(run + "/checkpoints/" + step).arrays.at(array);
}

// Adam divides by the size of each weight's gradient: rounding grows where that is nearly zero.
constexpr double f32_rounding = 2e-3;

TEST_F(Ranks, ARunGoesOnWithAnotherNumberOfRanks) {
  const std::string folder = test_folder("ranks");
  train_network(options_of(folder + "/one"));
  const nn::Weights expected = state_of(folder + "/one", "step-00000020");

  TrainingOptions options = options_of(folder + "/several");
  options.stop_step = 8;
  EXPECT_EQ(train_on(2, options).reason, StopReason::reached_stop_step);
  EXPECT_EQ(read_run_facts(folder + "/several").ranks, 2);
  options.resume = true;
  options.stop_step = 15;
  std::string said;
  options.message = [&](const std::string& text) { said += text + "\n"; };
  train_on(3, options);
  EXPECT_THAT(said, HasSubstr("resumed at step 8 on 3 ranks"));
  options.stop_step = 0;
  const TrainingResult result = train_network(options);
  EXPECT_EQ(result.reason, StopReason::finished);
  EXPECT_EQ(result.scene_samples, 80);
  for (const StateArray array : all_state_arrays)
    EXPECT_LT(difference(state_of(folder + "/one", "step-00000020", name_of(array)),
                         state_of(folder + "/several", "step-00000020", name_of(array))),
              f32_rounding)
        << name_of(array);
  EXPECT_EQ(nn::read_safetensors(result.weights_file).metadata.at("training.ranks"), "1");
  remove_path(folder);
}

TEST_F(Ranks, AllStopAfterTheStepInWhichOneIsAsked) {
  const std::string folder = test_folder("ranks_stop");
  std::vector<int64_t> steps(3);
  expect_all_well(run_ranks(3, [&](Comm& comm) {
    TrainingOptions options = options_of(folder + "/run");
    options.comm = &comm;
    int asked = 0;
    options.should_stop = [&asked, &comm] { return ++asked >= 6 && comm.rank() == 2; };
    const TrainingResult result = train_network(options);
    EXPECT_EQ(result.reason, StopReason::stopped);
    steps[static_cast<std::size_t>(comm.rank())] = result.step;
  }));
  EXPECT_EQ(steps, (std::vector<int64_t>{6, 6, 6}));
  EXPECT_TRUE(std::filesystem::exists(folder + "/run/checkpoints/step-00000006"));
  remove_path(folder);
}

TEST_F(Ranks, RankZeroKeepsTheStateWhenAnotherFails) {
  const std::string folder = test_folder("ranks_fail");
  const auto errors = run_ranks(2, [&](Comm& comm) {
    TrainingOptions options = options_of(folder + "/run");
    options.comm = &comm;
    int asked = 0;
    options.should_stop = [&asked, &comm]() -> bool {
      if (++asked == 6 && comm.rank() == 1) throw InputError("the disk of rank 1 is gone");
      return false;
    };
    train_network(options);
  });
  EXPECT_EQ(message_of(errors[1]), "the disk of rank 1 is gone");
  EXPECT_THAT(message_of(errors[0]), HasSubstr("another rank has ended"));
  EXPECT_TRUE(std::filesystem::exists(folder + "/run/checkpoints/step-00000006"));
  remove_path(folder);
}

/// The same bytes under another name are the same teacher.
TEST_F(Ranks, RanksWithDifferentTeachersAreRefused) {
  const std::string folder = test_folder("ranks_teacher");
  const auto teacher = [&](const std::string& name, uint64_t seed) {
    TrainingOptions options = options_of(folder + "/" + name);
    options.config.steps = 1;
    options.config.seed = seed;
    return train_network(options).weights_file;
  };
  const std::string first = teacher("first", 1), second = teacher("second", 2), copy = folder + "/copy.safetensors";
  std::filesystem::copy_file(first, copy);
  const auto errors = [&](const std::string& of_rank_1, const std::string& run) {
    return run_ranks(2, [&](Comm& comm) {
      TrainingOptions options = options_of(folder + "/" + run);
      options.config.steps = 1;
      options.comm = &comm;
      options.teacher = comm.leads() ? first : of_rank_1;
      train_network(options);
    });
  };
  expect_all_well(errors(copy, "equal"));
  const auto refused = errors(second, "other");
  const std::string hashes[] = {file_hash(first), file_hash(second)};
  EXPECT_THAT(message_of(refused[0]), HasSubstr("rank 0 of 2: the teacher '" + first + "' has the hash " + hashes[0] +
                                                ", that of rank 0 " + hashes[0] + " (ranks with another: 1"));
  EXPECT_THAT(message_of(refused[1]), HasSubstr("rank 1 of 2: the teacher '" + second + "' has the hash " + hashes[1] +
                                                ", that of rank 0 " + hashes[0]));
  EXPECT_FALSE(std::filesystem::exists(folder + "/other"));
  remove_path(folder);
}

TEST_F(Ranks, MoreRanksThanScenesAreRefused) {
  const std::string folder = test_folder("ranks_many");
  std::vector<std::exception_ptr> errors;
  TrainingOptions options = options_of(folder + "/run");
  options.config.batch_scenes = 1;
  train_on(2, options, &errors);
  for (const auto& error : errors) EXPECT_THAT(message_of(error), HasSubstr("2 ranks are too many"));
  EXPECT_FALSE(std::filesystem::exists(folder + "/run"));
  remove_path(folder);
}

}  // namespace
}  // namespace graupel::train
